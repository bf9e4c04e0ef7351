use super::candidate::{acting, best_start};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::study::Study;
use crate::model::{Effect, FittedEffect};

/// A set of effects in which one of a model's is replaced by another.
pub(super) struct Exchange {
    pub set: Vec<FittedEffect>,
    /// Of the effect that is replaced, and of the one in its place.
    pub labels: [String; 2],
}

/// Sets of effects in which one of a model's is replaced by another that it is easily confused with, on the same joint.
/// Seen from the model itself, such a pair promises little: each does most of what the other does.
pub(super) fn exchanges(study: &Study<'_>, library: &[Effect], fitted: &Fitted) -> Vec<Exchange> {
    let declared = study.declared.effects.len();
    let mut sets = Vec::new();
    for k in study.added(&fitted.model) {
        let mut rest = fitted.clone();
        let old = rest.model.effects.remove(k);
        let is_like = |new: &&Effect| {
            let names = |a: &Effect, b: &Effect| a.confused_with.contains(&b.name);
            names(&old.effect, new) || names(new, &old.effect)
        };
        let like: Vec<Effect> = library.iter().filter(is_like).cloned().collect();
        for new in acting(study, &like) {
            let present = &rest.model.effects;
            let is_free = !present.iter().any(|p| p.excludes(&new) || p.contains(&new));
            if new.joint == old.joint
                && is_free
                && let Some((start, _)) = best_start(study, &rest, &new)
            {
                let mut set = present[declared..].to_vec();
                let labels = [old.label(), start.label()];
                set.push(start);
                sets.push(Exchange { set, labels });
            }
        }
    }
    sets
}
