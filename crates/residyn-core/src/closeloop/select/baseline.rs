use crate::closeloop::problem::Problem;
use crate::model::{Effect, FittedEffect};

use super::candidate::acting;

/// The smallest baseline set: the friction of every joint, unless the model file has it.
pub fn baseline_friction(problem: &Problem<'_>) -> Vec<FittedEffect> {
    let mut sets = baseline_sets(problem).into_iter();
    sets.next().unwrap_or_default()
}

/// The baseline sets, which most machines have, each on all joints together: if every joint has friction, adding it to
/// one joint helps little. Each set holds the effects up to a baseline rank.
pub fn baseline_sets(problem: &Problem<'_>) -> Vec<Vec<FittedEffect>> {
    let declared = &problem.declared.effects;
    let mut ranks: Vec<usize> = (problem.effects().iter())
        .filter_map(|effect| effect.baseline)
        .collect();
    ranks.sort_unstable();
    ranks.dedup();
    let block = |highest: usize| {
        let is_usual = |effect: &&Effect| effect.baseline.is_some_and(|rank| rank <= highest);
        let usual: Vec<Effect> = (problem.effects().iter().filter(is_usual))
            .cloned()
            .collect();
        let mut block = acting(problem, &usual);
        block.retain(|new| !declared.iter().any(|old| old.excludes(new)));
        block
    };
    let mut blocks: Vec<_> = ranks.into_iter().map(block).collect();
    blocks.retain(|block| !block.is_empty());
    blocks.dedup_by_key(|block| block.len());
    blocks
}
