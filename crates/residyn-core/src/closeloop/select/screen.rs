use super::candidate::{beside, best_start, has_switch};
use super::outlook::Outlook;
use super::sets::promising;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::model::FittedEffect;

/// The sets of effects that promise to lower the loss of a fitted model most, the most promising first, each beyond the declared
/// effects. All candidates are linearised at once, and sets are compared without a fit; what no value switches off comes last, alone
/// beside the effects of the model, since it cannot be compared so.
pub fn screen(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidates: &[FittedEffect],
) -> Vec<Vec<FittedEffect>> {
    let mut sets = Vec::new();
    if let Some(outlook) = Outlook::of(problem, fitted, candidates) {
        let promising = promising(&outlook, problem);
        sets = promising.iter().map(|set| outlook.effects(set)).collect();
    }
    let declared = problem.declared.effects.len();
    let alone = |candidate: &FittedEffect| {
        let beside = beside(problem, fitted, candidate)?;
        let start = best_start(problem, &beside, candidate)?;
        Some([&beside.model.effects[declared..], &[start]].concat())
    };
    let unswitched = candidates.iter().filter(|c| !has_switch(c));
    sets.extend(unswitched.filter_map(alone));
    sets
}
