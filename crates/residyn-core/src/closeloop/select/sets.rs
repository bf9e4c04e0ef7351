use std::collections::HashSet;

use rayon::prelude::*;

use super::screening::{Minimum, Screening, Set};
use crate::closeloop::problem::Problem;

/// As many left-out losses are worked out at once, whatever the number of cores.
const AT_ONCE: usize = 16;

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
        let scored = lowest(screening, next, settings.beam_width);
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
        Some(lowest(screening, less, 1).pop()?.1)
    };
    std::iter::successors(less(&from), less).collect()
}

/// The sets with the lowest predicted losses on left-out blocks, the lowest first; those whose values the logs do not
/// distinguish are left out. The loss of a fit to all blocks is a lower bound, and in order of it few sets need more.
pub fn lowest(screening: &Screening, sets: Vec<Set>, count: usize) -> Vec<(f64, Set)> {
    let bounded = sets.into_par_iter();
    let bounded = bounded.filter_map(|set| Some((screening.minimum(&set)?, set)));
    let mut bounded: Vec<(Minimum, Set)> = bounded.collect();
    bounded.sort_by(|(a, _), (b, _)| a.loss.total_cmp(&b.loss));
    let mut lowest: Vec<(f64, Set)> = Vec::new();
    for few in bounded.chunks(AT_ONCE) {
        let is_lower = |(highest, _): &(f64, Set)| few[0].0.loss <= *highest;
        if lowest.len() >= count && !lowest.last().is_some_and(is_lower) {
            break;
        }
        let few = few.par_iter();
        let losses =
            few.filter_map(|(minimum, set)| Some((screening.left_out_loss(minimum)?, set.clone())));
        lowest.par_extend(losses);
        lowest.sort_by(|a, b| a.0.total_cmp(&b.0));
        lowest.truncate(count);
    }
    lowest
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
