use std::collections::HashSet;

use rayon::prelude::*;

use super::screening::{Screening, Set};
use crate::closeloop::problem::Problem;

/// Sets of a screening's items that are predicted to lower the loss on left-out blocks, found by a beam search: from
/// the items of the model, one item is added or dropped at a time, and the best few sets of each step start the next.
pub fn best_predicted(screening: &Screening, problem: &Problem<'_>) -> Vec<Set> {
    let settings = &problem.settings.select;
    let most = settings.most_effects_of(problem.declared.joints);
    let step = problem.of_whole(settings.round_gain);
    let start = screening.present();
    let Some(first) = screening.loss(&start) else {
        return Vec::new();
    };
    let mut seen: HashSet<Set> = HashSet::from([start.clone()]);
    let mut found: Vec<(f64, Set)> = vec![(first, start.clone())];
    let mut beam = vec![start];
    let mut best = first;
    for _ in 0..settings.beam_steps {
        let next = beam.iter().flat_map(|set| neighbours(screening, set, most));
        let mut next: Vec<Set> = next.collect();
        next.retain(|set| seen.insert(set.clone()));
        let mut scored = ranked(screening, next);
        scored.truncate(settings.beam_width);
        beam = scored.iter().map(|(_, set)| set.clone()).collect();
        let lowest = scored.first().map_or(f64::INFINITY, |(loss, _)| *loss);
        found.extend(scored);
        if lowest > best * (1.0 - step) {
            break;
        }
        best = best.min(lowest);
    }
    shortlist(found, settings.fitted_sets)
}

/// Sets with one item more or less; an added item replaces those that it contains.
fn neighbours(screening: &Screening, set: &Set, most: usize) -> Vec<Set> {
    let items = &screening.items;
    let contains = |whole: usize, part: usize| items[whole].contains(&items[part]);
    let toggled = |item: usize| {
        let mut other = set.clone();
        match set.binary_search(&item) {
            Ok(place) => {
                other.remove(place);
            }
            Err(_) => {
                other.retain(|part| !contains(item, *part));
                other.push(item);
                other.sort_unstable();
            }
        }
        other
    };
    let is_new = |item: &usize| !set.iter().any(|&whole| contains(whole, *item));
    let all = (0..items.len()).filter(is_new).map(toggled);
    all.filter(|set| set.len() <= most).collect()
}

/// Sets with ever fewer of some items: each drops from the one before the item that leaves the lowest predicted loss on
/// left-out blocks.
pub fn descent(screening: &Screening, from: Set) -> Vec<Set> {
    let less = |set: &Set| {
        let without = |k: usize| [&set[..k], &set[k + 1..]].concat();
        let less = (0..set.len()).map(without).collect();
        Some(ranked(screening, less).into_iter().next()?.1)
    };
    std::iter::successors(less(&from), less).collect()
}

/// Sets with their predicted losses, the lowest first; those whose values the logs do not distinguish are left out.
pub fn ranked(screening: &Screening, sets: Vec<Set>) -> Vec<(f64, Set)> {
    let scored = sets.into_par_iter();
    let scored = scored.filter_map(|set| Some((screening.loss(&set)?, set)));
    let mut scored: Vec<(f64, Set)> = scored.collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored
}

/// The best set of each size, then the best of the rest.
fn shortlist(mut ranked: Vec<(f64, Set)>, most: usize) -> Vec<Set> {
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut sizes = HashSet::new();
    let (mut first, rest): (Vec<_>, Vec<_>) =
        (ranked.into_iter()).partition(|(_, set)| sizes.insert(set.len()));
    first.extend(rest);
    first.truncate(most);
    first.into_iter().map(|(_, set)| set).collect()
}
