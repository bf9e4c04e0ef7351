use std::ops::Range;

use super::trial::is_consistent;
use crate::closeloop::problem::Problem;
use crate::model::{Effect, EffectParameter, FittedEffect};

/// Every set in which one effect is replaced by some of the effects that it contains and the set lacks, fewest first.
/// Only effects at the indices `added` change.
pub fn simpler(
    problem: &Problem<'_>,
    effects: &[FittedEffect],
    added: Range<usize>,
) -> Vec<Vec<FittedEffect>> {
    let mut all = Vec::new();
    for k in added {
        let old = &effects[k];
        for parts in parts_of(problem.effects(), &old.effect) {
            let parts: Vec<FittedEffect> = (parts.into_iter())
                .map(|effect| part_of(problem, old, effect))
                .collect();
            let mut rest = effects.to_vec();
            rest.remove(k);
            if parts.iter().all(|part| is_free_of(part, &rest)) {
                rest.splice(k..k, parts);
                all.push(rest);
            }
        }
    }
    all
}

/// Whether an effect can be added to others: no effect can act twice.
pub(super) fn is_free_of(new: &FittedEffect, others: &[FittedEffect]) -> bool {
    !others.iter().any(|other| other.excludes(new))
}

/// A set in which each effect whose values are not consistent is replaced by the effects that it contains: all that the
/// set and the declared effects lack, since simpler sets are found from there.
pub(super) fn repaired(
    problem: &Problem<'_>,
    declared: &[FittedEffect],
    effects: &[FittedEffect],
) -> Vec<FittedEffect> {
    let present = [declared, effects].concat();
    let mend = |effect: &FittedEffect| {
        if is_consistent(effect) {
            return vec![effect.clone()];
        }
        let sets = parts_of(problem.effects(), &effect.effect);
        let richest = sets.last().into_iter().flatten();
        let parts = richest.map(|part| part_of(problem, effect, part));
        parts.filter(|part| is_free_of(part, &present)).collect()
    };
    effects.iter().flat_map(mend).collect()
}

/// The single effects that another contains, with its values: each could take its place alone.
pub fn parts(problem: &Problem<'_>, whole: &FittedEffect) -> Vec<FittedEffect> {
    let mut sets = parts_of(problem.effects(), &whole.effect);
    sets.retain(|set| set.len() == 1);
    let parts = sets.concat().into_iter();
    parts.map(|part| part_of(problem, whole, part)).collect()
}

/// The sets of effects contained in `whole` that have fewer parameters together, fewest first.
fn parts_of<'l>(library: &'l [Effect], whole: &Effect) -> Vec<Vec<&'l Effect>> {
    let is_part = |effect: &&Effect| whole.contains.contains(&effect.name);
    let parts: Vec<&Effect> = library.iter().filter(is_part).collect();
    let chosen = |set: usize| -> Vec<&Effect> {
        let members = parts.iter().enumerate();
        let members = members.filter(|(bit, _)| set >> bit & 1 == 1);
        members.map(|(_, effect)| *effect).collect()
    };
    let parameters =
        |set: &Vec<&Effect>| -> usize { set.iter().map(|effect| effect.parameters.len()).sum() };
    let mut sets: Vec<Vec<&Effect>> = (1..1_usize << parts.len()).map(chosen).collect();
    sets.retain(|set| parameters(set) < whole.parameters.len());
    sets.sort_by_key(|set| (parameters(set), set.len()));
    sets
}

/// A simpler effect that another contains, with the values of the parameters of the same names or, if there are none, of
/// the same unit.
fn part_of(problem: &Problem<'_>, whole: &FittedEffect, part: &Effect) -> FittedEffect {
    let part = problem.measured(part, whole.joint);
    let mut fitted = FittedEffect::absent(&part, whole.joint);
    let known = whole.effect.parameters.iter().zip(&whole.values);
    for (parameter, slot) in part.parameters.iter().zip(&mut fitted.values) {
        let is_same = |(own, _): &(&EffectParameter, _)| own.name == parameter.name;
        let is_alike = |(own, _): &(&EffectParameter, _)| own.unit == parameter.unit;
        let same = known.clone().find(is_same);
        if let Some((_, (value, _))) = same.or_else(|| known.clone().find(is_alike)) {
            *slot = (*value, None);
        }
    }
    fitted
}
