use std::collections::HashSet;

use super::candidate::{acting, best_start, has_switch, numbered, screened_cost_on_sample, starts};
use super::identity::EffectId;
use super::on_sample::cost_on_sample;
use super::screening::Screening;
use super::sets::lowest;
use super::trial::Trial;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::model::{Effect, FittedEffect};

/// A set in which one of a model's effects is replaced by another.
pub(super) struct Exchange {
    pub set: Vec<FittedEffect>,
    pub pair: Pair,
}

/// Identifies an effect and its replacement.
pub(super) type Pair = [EffectId; 2];

/// Exchanges that came nowhere near the set that they were tried in.
pub(super) struct Hopeless {
    pairs: HashSet<Pair>,
    /// Loss of the model, in units of the sensors' noise, since when they count.
    loss: f64,
}

impl Default for Hopeless {
    /// None was tried.
    fn default() -> Self {
        Self {
            pairs: HashSet::new(),
            loss: f64::INFINITY,
        }
    }
}

impl Hopeless {
    /// Once the loss has fallen far, any exchange is worth a try.
    pub fn forget_after_far_fall(&mut self, problem: &Problem<'_>, from: &Trial) {
        if from.has_fallen_far(self.loss, &problem.settings.select) {
            self.pairs.clear();
            self.loss = from.loss_in_noise();
        }
    }
}

/// One of a model's effects, by its place, and another that may replace it.
struct Swap {
    place: usize,
    new: FittedEffect,
}

/// Sets in which one of a model's effects is replaced by another that it is easily confused with, on the same joint.
/// Added to the model, such an effect predicts little gain, since each does most of what the other does. An effect with
/// a whole number, which was found with other effects in the set, is also exchanged for itself with another number: the
/// one with the largest predicted gain, and those next to the present one. Exchanges that are predicted to leave a loss
/// beyond the limit on left-out blocks are left out, and so are the `hopeless` ones, whose fits to the sample of windows came
/// nowhere near the model's: those that turn out to be are added to them.
pub(super) fn exchanges(
    problem: &Problem<'_>,
    fitted: &Fitted,
    limit: f64,
    hopeless: &mut Hopeless,
) -> Vec<Exchange> {
    let declared = problem.declared.effects.len();
    let fitted = fitted.clone().without_windows();
    let pair = |swap: &Swap| {
        let old = &fitted.model.effects[swap.place];
        [problem.id(old), problem.id(&swap.new)]
    };
    let mut swaps = swaps(problem, &fitted);
    swaps.retain(|swap| !hopeless.pairs.contains(&pair(swap)));
    let swaps = promising(problem, &fitted, swaps, limit);
    if swaps.is_empty() {
        return Vec::new();
    }
    let Some(below) = promising_on_sample(problem, &fitted) else {
        return Vec::new();
    };
    let mut sets = Vec::new();
    for swap in swaps {
        let (pair, Swap { place, new }) = (pair(&swap), swap);
        let mut rest = fitted.clone();
        let old = rest.model.effects.remove(place);
        let is_itself = new.effect.name == old.effect.name;
        let mut starts = Vec::new();
        if !is_itself || has_switch(&new) {
            let start = in_place_of(problem, &rest, (&old, &new), below);
            // Which transmission it is may show only once the friction of the link is found.
            if start.is_none() && !new.effect.is_transmission() {
                hopeless.pairs.insert(pair);
            }
            starts.extend(start);
        }
        if is_itself {
            starts.extend(with_numbers_beside(problem, &rest, &old, below));
        }
        sets.extend(starts.into_iter().map(|start| {
            let pair = [problem.id(&old), problem.id(&start)];
            let set = [&rest.model.effects[declared..], &[start]].concat();
            Exchange { set, pair }
        }));
    }
    sets
}

/// The effects of a model with all that may replace them. Transmissions replace each other alone: what they are confused with
/// does not hide them where they are added, and explains less. A motion tells what refines others only from all of them.
fn swaps(problem: &Problem<'_>, fitted: &Fitted) -> Vec<Swap> {
    let by_torques = problem.error_model == ErrorModel::InverseDynamics;
    let mut swaps = Vec::new();
    for place in problem.added(&fitted.model) {
        let mut rest = fitted.model.effects.clone();
        let old = rest.remove(place);
        let is_there = |part: &String| {
            let mut own = fitted.model.effects.iter();
            own.any(|own| own.joint == old.joint && own.effect.name == *part)
        };
        let is_like = |new: &&Effect| {
            let is_counted = new.parameters.iter().any(|parameter| parameter.whole);
            let is_another = old.effect.is_confused_with(new)
                && old.effect.is_transmission() == new.is_transmission()
                && (!new.refines || by_torques || new.contains.iter().all(is_there));
            is_another || is_counted && new.name == old.effect.name
        };
        let like: Vec<Effect> = problem.effects().iter().filter(is_like).cloned().collect();
        let mut new = acting(problem, &like);
        let is_free = |new: &FittedEffect| !rest.iter().any(|p| p.excludes(new) || p.contains(new));
        new.retain(|new| new.joint == old.joint && is_free(new));
        swaps.extend(new.into_iter().map(|new| Swap { place, new }));
    }
    swaps
}

/// The swaps that may leave a loss within the limit. One linearisation predicts it for all of them if torques are
/// compared, which nearly all effects enter linearly; motion shows only in a fit.
fn promising(problem: &Problem<'_>, fitted: &Fitted, swaps: Vec<Swap>, limit: f64) -> Vec<Swap> {
    if problem.error_model == ErrorModel::OutputError {
        return swaps;
    }
    let starts = |swap: &Swap| match has_switch(&swap.new) {
        true => starts(&swap.new),
        false => Vec::new(),
    };
    let starts: Vec<Vec<FittedEffect>> = swaps.iter().map(starts).collect();
    let Some(screening) = Screening::with(problem, fitted, &numbered(starts.concat())) else {
        return swaps;
    };
    let first = problem.added(&fitted.model).start;
    let present = screening.present();
    let mut next = present.len();
    let is_promising = |(swap, starts): (&Swap, Vec<FittedEffect>)| {
        let items = next..next + starts.len();
        next = items.end;
        let rest = present
            .iter()
            .copied()
            .filter(|item| first + item != swap.place);
        let rest: Vec<usize> = rest.collect();
        let set = |item| [rest.as_slice(), &[item]].concat();
        let best = lowest(&screening, items.map(set).collect(), 1);
        starts.is_empty() || best.first().is_some_and(|(loss, _)| *loss <= limit)
    };
    let promise: Vec<bool> = swaps.iter().zip(starts).map(is_promising).collect();
    let promising = swaps
        .into_iter()
        .zip(promise)
        .filter(|(_, promise)| *promise);
    promising.map(|(swap, _)| swap).collect()
}

/// The cost over the sample of windows that a set as good as a model's may leave there.
fn promising_on_sample(problem: &Problem<'_>, fitted: &Fitted) -> Option<f64> {
    let settings = &problem.settings.select;
    let rise = settings.prediction_slack * settings.simpler_rise;
    Some(cost_on_sample(problem, fitted)? * (1.0 + rise))
}

/// The effect that replaces another: at its best start or, if the prediction is better there, at the value of the old
/// one. The replacement of a strong effect is far from absent.
fn in_place_of(
    problem: &Problem<'_>,
    rest: &Fitted,
    (old, new): (&FittedEffect, &FittedEffect),
    below: f64,
) -> Option<FittedEffect> {
    let absent = best_start(problem, rest, new, below)?;
    let is_predicted_better = |carried: &FittedEffect| {
        let starts = [carried, &absent];
        let [carried, absent] = starts.map(|start| screened_cost_on_sample(problem, rest, start));
        carried.is_some_and(|carried| absent.is_none_or(|absent| carried < absent))
    };
    let carried = carried_over(old, &absent).filter(is_predicted_better);
    Some(carried.unwrap_or(absent))
}

/// An effect with the searched whole numbers next to its present one, or the ends of the range of one with a single start:
/// where it starts from absent if some value switches it off, else at its other values.
fn with_numbers_beside(
    problem: &Problem<'_>,
    rest: &Fitted,
    old: &FittedEffect,
    below: f64,
) -> Vec<FittedEffect> {
    let mut starts = Vec::new();
    for (k, parameter) in old.effect.parameters.iter().enumerate() {
        if !parameter.whole {
            continue;
        }
        let own = old.values[k].0;
        let numbers = || match parameter.starts.as_slice() {
            [_] => parameter.bounds.iter().copied(),
            starts => starts.iter().copied(),
        };
        let less = numbers().filter(|number| *number < own).reduce(f64::max);
        let more = numbers().filter(|number| *number > own).reduce(f64::min);
        for number in less.into_iter().chain(more) {
            if !has_switch(old) {
                let mut moved = old.clone();
                moved.values[k].0 = number;
                starts.push(moved);
                continue;
            }
            let mut single = old.clone();
            single.effect.parameters[k].starts = vec![number];
            starts.extend(
                best_start(problem, rest, &single, below).map(|start| FittedEffect {
                    effect: old.effect.clone(),
                    ..start
                }),
            );
        }
    }
    starts
}

/// An effect at the value of another, if each has one value, in the same unit.
fn carried_over(old: &FittedEffect, new: &FittedEffect) -> Option<FittedEffect> {
    let ([was], [is]) = (&old.effect.parameters[..], &new.effect.parameters[..]) else {
        return None;
    };
    let mut carried = new.clone();
    carried.values[0].0 = old.values[0].0.clamp(is.bounds[0], is.bounds[1]);
    (was.unit == is.unit).then_some(carried)
}
