use super::candidate::{beside, best_start, has_switch};
use super::screening::Screening;
use super::sets::best_predicted;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::model::FittedEffect;

/// The sets of effects with the largest predicted fall of a fitted model's loss, the best first, each beyond the
/// declared effects. All candidates are linearised at once, and sets are compared without a fit. Effects that no value
/// switches off cannot be compared this way and come last, each alone added to the effects of the model.
pub fn screen(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidates: &[FittedEffect],
) -> Vec<Vec<FittedEffect>> {
    let mut sets = Vec::new();
    if let Some(screening) = Screening::of(problem, fitted, candidates) {
        let predicted = best_predicted(&screening, problem);
        sets = predicted.iter().map(|set| screening.effects(set)).collect();
    }
    let unswitched = candidates.iter().filter(|c| !has_switch(c));
    sets.extend(each_alone(problem, fitted, unswitched));
    sets
}

/// The effects of a fitted model, beyond the declared ones, with each candidate alone at its best starting point.
pub fn each_alone<'c>(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidates: impl IntoIterator<Item = &'c FittedEffect>,
) -> Vec<Vec<FittedEffect>> {
    let declared = problem.declared.effects.len();
    let alone = |candidate: &FittedEffect| {
        let beside = beside(problem, fitted, candidate)?;
        let start = best_start(problem, &beside, candidate)?;
        Some([&beside.model.effects[declared..], &[start]].concat())
    };
    candidates.into_iter().filter_map(alone).collect()
}
