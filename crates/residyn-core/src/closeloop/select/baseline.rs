use crate::closeloop::problem::Problem;
use crate::model::{Effect, Entry, FittedEffect};

use super::candidate::acting;

impl Problem<'_> {
    /// These effects, each at its values in the first optimum, if it has it.
    pub(super) fn at_first_optimum(&self, effects: Vec<FittedEffect>) -> Vec<FittedEffect> {
        let known = self.first.as_ref().map(|first| &first.model.effects);
        let found = |effect: FittedEffect| {
            let same = known.and_then(|known| known.iter().find(|known| known.is_same(&effect)));
            same.cloned().unwrap_or(effect)
        };
        effects.into_iter().map(found).collect()
    }
}

/// The smallest baseline set: the friction of every joint, unless the model file has it.
pub fn baseline_friction(problem: &Problem<'_>) -> Vec<FittedEffect> {
    let mut sets = baseline_sets(problem).into_iter();
    sets.next().unwrap_or_default()
}

/// The friction and a constant torque of every joint, as far as the model file has none: a model without them may explain
/// what they do by values that are far off.
pub fn usual_forces(problem: &Problem<'_>) -> Vec<FittedEffect> {
    let sets = baseline_sets(problem).into_iter();
    sets.take(2).next_back().unwrap_or_default()
}

/// These and the inertias that most machines have beside those of their links, without delays.
pub fn forces_and_rotors(problem: &Problem<'_>) -> Vec<FittedEffect> {
    let mut all = baseline_sets(problem).pop().unwrap_or_default();
    all.retain(|own| matches!(own.effect.entry, Entry::Force(_) | Entry::Inertia(_)));
    all
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
