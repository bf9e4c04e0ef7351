use crate::closeloop::problem::Problem;
use crate::model::{Effect, FittedEffect};

use super::candidate::acting;

/// The first of the sets that most machines have: the friction of every joint, unless the model file has it.
pub fn usual_friction(problem: &Problem<'_>) -> Vec<FittedEffect> {
    blocks(problem).into_iter().next().unwrap_or_default()
}

/// What most machines have, each set on all joints together: where every joint has friction, none of it helps much alone. Each set
/// holds the effects up to a baseline rank.
pub fn blocks(problem: &Problem<'_>) -> Vec<Vec<FittedEffect>> {
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
