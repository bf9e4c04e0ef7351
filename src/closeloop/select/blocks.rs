use crate::closeloop::study::Study;
use crate::model::{Effect, FittedEffect};

use super::candidate::acting;

/// What most machines have, each set on all joints together: where every joint has friction, none of it helps much
/// alone.
const COMMON: [&[&str]; 3] = [
    &["viscous_friction", "coulomb_friction"],
    &["viscous_friction", "coulomb_friction", "constant_torque"],
    &[
        "viscous_friction",
        "coulomb_friction",
        "constant_torque",
        "actuator_delay",
    ],
];

/// The friction of every joint that most machines have.
pub fn usual_friction(study: &Study<'_>, library: &[Effect]) -> Vec<FittedEffect> {
    blocks(study, library)
        .into_iter()
        .next()
        .unwrap_or_default()
}

/// Sets of effects that are tried before any other.
pub fn blocks(study: &Study<'_>, library: &[Effect]) -> Vec<Vec<FittedEffect>> {
    let declared = &study.declared.effects;
    let block = |names: &&[&str]| {
        let is_named = |effect: &&Effect| names.contains(&effect.name.as_str());
        let named: Vec<Effect> = library.iter().filter(is_named).cloned().collect();
        let mut block = acting(study, &named);
        block.retain(|new| !declared.iter().any(|old| old.excludes(new)));
        block
    };
    let mut blocks: Vec<_> = COMMON.iter().map(block).collect();
    blocks.retain(|block| !block.is_empty());
    blocks.dedup_by_key(|block| block.len());
    blocks
}
