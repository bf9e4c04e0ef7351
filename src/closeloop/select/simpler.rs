use std::ops::Range;

use crate::model::{Effect, FittedEffect};

/// Every set of effects that is one step simpler: one effect less, or one replaced by some of those that it
/// contains, fewest first. Only effects at the places `added` change.
pub(super) fn simpler(
    library: &[Effect],
    effects: &[FittedEffect],
    added: Range<usize>,
) -> Vec<Vec<FittedEffect>> {
    let mut all = Vec::new();
    for k in added {
        let mut without = effects.to_vec();
        let old = without.remove(k);
        for parts in parts_of(library, &old.effect) {
            let parts = parts
                .into_iter()
                .map(|effect| FittedEffect::absent(effect, old.joint));
            let mut replaced = without.clone();
            replaced.splice(k..k, parts);
            all.push(replaced);
        }
        // The effect that came last is what the round was about: it is replaced at most.
        if k + 1 < effects.len() {
            all.insert(0, without);
        }
    }
    all
}

/// The sets of effects contained in one that take fewer names and parameters together, fewest first: one effect
/// with four parameters says less than three effects with one each.
fn parts_of<'l>(library: &'l [Effect], whole: &Effect) -> Vec<Vec<&'l Effect>> {
    let is_part = |effect: &&Effect| whole.contains.contains(&effect.name);
    let parts: Vec<&Effect> = library.iter().filter(is_part).collect();
    let chosen = |set: usize| -> Vec<&Effect> {
        let members = parts
            .iter()
            .enumerate()
            .filter(|(bit, _)| set >> bit & 1 == 1);
        members.map(|(_, effect)| *effect).collect()
    };
    let own = |effect: &Effect| 1 + effect.parameters.len();
    let size = |set: &Vec<&Effect>| set.iter().map(|effect| own(effect)).sum::<usize>();
    let mut sets: Vec<Vec<&Effect>> = (1..1_usize << parts.len()).map(chosen).collect();
    sets.retain(|set| size(set) < own(whole));
    sets.sort_by_key(size);
    sets
}
