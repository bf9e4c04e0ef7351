use super::candidate::{acting, best_start, screened_cost};
use super::identity::EffectId;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::model::{Effect, FittedEffect};

/// A set in which one of a model's effects is replaced by another.
pub(super) struct Exchange {
    pub set: Vec<FittedEffect>,
    /// Identifies the replaced effect and its replacement.
    pub pair: [EffectId; 2],
}

/// Sets in which one of a model's effects is replaced by another that it is easily confused with, on the same joint.
/// Added to the model, such an effect predicts little gain, since each does most of what the other does. An effect with
/// a whole number, which was found with other effects in the set, is also exchanged for itself with another number: the
/// one with the largest predicted gain, and those next to the present one.
pub(super) fn exchanges(problem: &Problem<'_>, fitted: &Fitted) -> Vec<Exchange> {
    let declared = problem.declared.effects.len();
    let mut sets = Vec::new();
    for k in problem.added(&fitted.model) {
        let mut rest = fitted.clone();
        let old = rest.model.effects.remove(k);
        let is_like = |new: &&Effect| {
            let is_counted = new.parameters.iter().any(|parameter| parameter.whole);
            old.effect.is_confused_with(new) || is_counted && new.name == old.effect.name
        };
        let like: Vec<Effect> = problem.effects().iter().filter(is_like).cloned().collect();
        for new in acting(problem, &like) {
            let present = &rest.model.effects;
            let is_free = !present.iter().any(|p| p.excludes(&new) || p.contains(&new));
            if new.joint != old.joint || !is_free {
                continue;
            }
            let mut starts = Vec::from_iter(in_place_of(problem, &rest, &old, &new));
            if new.effect.name == old.effect.name {
                starts.extend(with_numbers_beside(problem, &rest, &old));
            }
            sets.extend(starts.into_iter().map(|start| {
                let pair = [problem.id(&old), problem.id(&start)];
                let set = [&present[declared..], &[start]].concat();
                Exchange { set, pair }
            }));
        }
    }
    sets
}

/// The effect that replaces another: at its best start or, if the prediction is better there, at the value of the old
/// one. The replacement of a strong effect is far from absent.
fn in_place_of(
    problem: &Problem<'_>,
    rest: &Fitted,
    old: &FittedEffect,
    new: &FittedEffect,
) -> Option<FittedEffect> {
    let absent = best_start(problem, rest, new)?;
    let is_predicted_better = |carried: &FittedEffect| {
        let [carried, absent] = [carried, &absent].map(|start| screened_cost(problem, rest, start));
        carried.is_some_and(|carried| absent.is_none_or(|absent| carried < absent))
    };
    let carried = carried_over(old, &absent).filter(is_predicted_better);
    Some(carried.unwrap_or(absent))
}

/// An effect with the searched whole numbers next to its present one.
fn with_numbers_beside(
    problem: &Problem<'_>,
    rest: &Fitted,
    old: &FittedEffect,
) -> Vec<FittedEffect> {
    let mut starts = Vec::new();
    for (k, parameter) in old.effect.parameters.iter().enumerate() {
        if !parameter.whole {
            continue;
        }
        let own = old.values[k].0;
        let numbers = || parameter.starts.iter().copied();
        let below = numbers().filter(|number| *number < own).reduce(f64::max);
        let above = numbers().filter(|number| *number > own).reduce(f64::min);
        for number in below.into_iter().chain(above) {
            let mut single = old.clone();
            single.effect.parameters[k].starts = vec![number];
            starts.extend(
                best_start(problem, rest, &single).map(|start| FittedEffect {
                    effect: old.effect.clone(),
                    ..start
                }),
            );
        }
    }
    starts
}

/// An effect at the value of another, if each has one value, in the same unit.
fn carried_over(old: &FittedEffect, new: &FittedEffect) -> Option<FittedEffect> {
    let ([was], [is]) = (&old.effect.parameters[..], &new.effect.parameters[..]) else {
        return None;
    };
    let mut carried = new.clone();
    carried.values[0].0 = old.values[0].0.clamp(is.bounds[0], is.bounds[1]);
    (was.unit == is.unit).then_some(carried)
}
