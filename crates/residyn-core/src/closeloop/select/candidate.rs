use std::collections::HashSet;
use std::ops::Range;

use rayon::prelude::*;

use super::equations::{Eliminated, not_at_bounds, solve_among, step_from_bounds};
use super::on_sample::fitted_on_sample;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::{Joint, Quantity, moves_as_one};
use crate::identify::{Fit, Shooting, WindowTerms, as_it_stands, predicted_cost};
use crate::model::{Dynamics, Effect, EffectParameter, Entry, FittedEffect, Model};

/// Every effect of the library on every joint where it can act and is not yet in the model, and every shift of a
/// parameter that the file declares fixed.
pub fn candidates(problem: &Problem<'_>, present: &[FittedEffect]) -> Vec<FittedEffect> {
    let mut all: Vec<FittedEffect> = problem.declared.shifts();
    let effects = problem.effects().iter().filter(|effect| !effect.refines);
    all.extend(acting(problem, effects));
    all.retain(|new| !present.iter().any(|old| old.excludes(new)));
    all
}

/// These effects on every joint where each can act and be observed.
pub fn acting<'e>(
    problem: &Problem<'_>,
    effects: impl IntoIterator<Item = &'e Effect>,
) -> Vec<FittedEffect> {
    let mut all = Vec::new();
    let observable = effects.into_iter();
    let observable = observable.filter(|effect| problem.shows(effect));
    for effect in observable {
        for joint in Joint::all(problem.declared.joints) {
            if is_driven_enough(problem, effect, joint)
                && !is_identified_by_bodies(problem, effect)
                && !is_turn_of_bodies(problem, effect)
                && !is_of_too_many(problem, effect)
                && problem.declared.can_carry(effect, joint).is_ok()
                && !is_of_one_motion(problem, effect, joint)
            {
                all.push(FittedEffect::absent(
                    &problem.measured(effect, joint),
                    joint,
                ));
            }
        }
    }
    all
}

/// With free bodies, no torque distinguishes a load at the tip from the last body: only the declared values do, in a
/// separate stage.
fn is_identified_by_bodies(problem: &Problem<'_>, effect: &Effect) -> bool {
    matches!(effect.entry, Entry::Payload(_)) && problem.has_free_bodies()
}

/// A motor between two joints that move as one is no different from friction and inertia of each.
fn is_of_one_motion(problem: &Problem<'_>, effect: &Effect, joint: Joint) -> bool {
    effect.is_coupling() && moves_as_one(problem.logs, joint, joint.next())
}

/// A drive that closes its loop on the sensor moves with the sensor's zero, which then turns only gravity: so do free
/// bodies.
fn is_turn_of_bodies(problem: &Problem<'_>, effect: &Effect) -> bool {
    effect.is_of_sensor()
        && problem.declared.driven_by() != Quantity::Torque
        && problem.has_free_bodies()
}

/// Whether an effect has a value for each log and there are too many logs to consider it.
pub fn is_of_too_many(problem: &Problem<'_>, effect: &Effect) -> bool {
    problem.logs.len() > problem.settings.select.most_logs_of_own_values
        && effect.parameters.iter().any(|parameter| parameter.per_log)
}

/// Effects of the torque cannot be observed without torque.
fn is_driven_enough(problem: &Problem<'_>, effect: &Effect, joint: Joint) -> bool {
    !effect.needs_torque() || problem.top_torque[joint] > 0.0
}

/// The candidate at each of its starting points: every combination of the searched values.
pub fn starts(candidate: &FittedEffect) -> Vec<FittedEffect> {
    let mut points = vec![Vec::new()];
    for parameter in &candidate.effect.parameters {
        let grown = points.iter().flat_map(|point| {
            let starts = parameter.starts.iter();
            starts.map(move |start| [point.as_slice(), &[(*start, None)]].concat())
        });
        points = grown.collect();
    }
    let at = |values| FittedEffect {
        values,
        ..candidate.clone()
    };
    points.into_iter().map(at).collect()
}

/// The starting point of a candidate with the largest predicted decrease of a model's cost, on a sample of the windows. What
/// no value switches off has several steps of a fit of its motion behind it, which lead below this cost of the sample.
pub fn best_start(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidate: &FittedEffect,
    below: f64,
) -> Option<FittedEffect> {
    let mut starts = starts(candidate);
    if starts.len() < 2 {
        return starts.pop();
    }
    if has_switch(candidate) {
        return best_by_switches(problem, fitted, &[starts]).pop()?;
    }
    match problem.error_model {
        ErrorModel::InverseDynamics => best_by_cost(problem, fitted, starts),
        ErrorModel::OutputError => {
            let best = fitted_on_sample(problem, fitted, starts, below)?;
            best.effects.last().cloned()
        }
    }
}

/// As [`best_start`], for all these candidates, which some value switches off, in their order.
pub fn best_starts(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidates: &[FittedEffect],
) -> Vec<FittedEffect> {
    // No window of the fit is needed, and every copy would hold all of them.
    let fitted = &fitted.clone().without_windows();
    type Group = (Fitted, Vec<(usize, Vec<FittedEffect>)>);
    let mut found: Vec<(usize, FittedEffect)> = Vec::new();
    let mut groups: Vec<Group> = Vec::new();
    for (number, candidate) in candidates.iter().enumerate() {
        let Some(beside) = beside(problem, fitted, candidate) else {
            continue;
        };
        let mut starts = starts(candidate);
        if starts.len() < 2 {
            found.extend(starts.pop().map(|start| (number, start)));
            continue;
        }
        // One linearisation has at most as many candidates as the model has values.
        let size = beside.fit.columns.len();
        let joined = groups
            .iter_mut()
            .find(|(other, own)| own.len() < size && other.model.effects == beside.model.effects);
        match joined {
            Some((_, own)) => own.push((number, starts)),
            None => groups.push((beside, vec![(number, starts)])),
        }
    }
    let best = |(beside, own): Group| {
        let (numbers, starts): (Vec<usize>, Vec<_>) = own.into_iter().unzip();
        let best = best_by_switches(problem, &beside, &starts);
        let best = numbers.into_iter().zip(best);
        Vec::from_iter(best.filter_map(|(number, best)| Some((number, best?))))
    };
    let best: Vec<_> = groups.into_par_iter().map(best).collect();
    found.extend(best.concat());
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, start)| start).collect()
}

/// The predicted cost over all windows of a model with a candidate at its values.
pub fn screened_cost(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidate: &FittedEffect,
) -> Option<f64> {
    let start_states = &fitted.fit.start_states;
    linearised_cost(problem, &problem.shooting, fitted, candidate, start_states)
}

/// As [`screened_cost`], over a sample of the windows.
pub fn screened_cost_on_sample(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidate: &FittedEffect,
) -> Option<f64> {
    let start_states = problem.sample.start_states(&fitted.fit.start_states);
    let shooting = &problem.sample.shooting;
    linearised_cost(problem, shooting, fitted, candidate, &start_states)
}

/// The cost over the windows that one Gauss-Newton step predicts for a candidate.
fn linearised_cost(
    problem: &Problem<'_>,
    shooting: &Shooting<'_>,
    fitted: &Fitted,
    start: &FittedEffect,
    start_states: &[Vec<f64>],
) -> Option<f64> {
    let dynamics = problem.extended(fitted, std::slice::from_ref(start));
    let (active, scale) = (problem.active(&dynamics), fitted.fit.scale);
    predicted_cost(shooting, &dynamics, &active, start_states, scale)
}

/// The model that a candidate joins: without the simpler effects that it contains, unless the file declares
/// them. `None` if the model has an effect that contains the candidate.
pub fn beside(problem: &Problem<'_>, fitted: &Fitted, candidate: &FittedEffect) -> Option<Fitted> {
    let mut present = fitted.model.effects.iter();
    if present.any(|present| present.contains(candidate)) {
        return None;
    }
    let mut beside = fitted.clone();
    let declared = problem.declared.effects.len();
    let mut added = beside.model.effects.split_off(declared);
    added.retain(|present| !candidate.contains(present));
    beside.model.effects.extend(added);
    Some(beside)
}

/// The starting point with the lowest cost on the sample of windows, as a linearisation of each predicts: nearly all effects
/// enter torques linearly.
pub fn best_by_cost(
    problem: &Problem<'_>,
    fitted: &Fitted,
    starts: Vec<FittedEffect>,
) -> Option<FittedEffect> {
    let predicted = |start| Some((screened_cost_on_sample(problem, fitted, &start)?, start));
    let predicted = starts.into_par_iter().filter_map(predicted);
    let predicted: Vec<(f64, FittedEffect)> = predicted.collect();
    let best = predicted.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(best.1)
}

/// As above, for candidates that are absent at every starting point: one linearisation compares all of them, since only
/// the parameters that switch the effects on change anything there.
fn best_by_switches(
    problem: &Problem<'_>,
    fitted: &Fitted,
    starts: &[Vec<FittedEffect>],
) -> Vec<Option<FittedEffect>> {
    let numbered = numbered(starts.concat());
    let model = fitted.model.with_effects(fitted.effects_and(&numbered));
    let dynamics = problem.compiled(&model);
    let first = fitted.model.effects.len();
    let places: Vec<Range<usize>> = (first..model.effects.len())
        .map(|k| model.place_of(k))
        .collect();
    let switches = switches(&model);
    let mut active = problem.active(&dynamics);
    active.retain(|k| *k < places[0].start || switches.contains(k));
    let start_states = problem.sample.start_states(&fitted.fit.start_states);
    let (shooting, scale) = (&problem.sample.shooting, fitted.fit.scale);
    let Ok(fit) = as_it_stands(shooting, &dynamics, &active, start_states, scale) else {
        return vec![None; starts.len()];
    };
    let least = LeastCost::of(&dynamics, &fit, fit.columns_of(|k| k < places[0].start));
    let mut places = places.into_iter();
    let best = |starts: &Vec<FittedEffect>| {
        let costs: Vec<Option<f64>> = (places.by_ref().take(starts.len()))
            .map(|place| least.with(fit.columns_of(|k| place.contains(&k))))
            .collect();
        let costs = costs.into_iter().zip(starts);
        let known = costs.filter_map(|(cost, start)| Some((cost?, start)));
        let best = known.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(best.1.clone())
    };
    starts.iter().map(best).collect()
}

/// Minima of the quadratic cost over some free values, the base among them; values at a bound that would leave it are held.
struct LeastCost<'a> {
    dynamics: &'a Dynamics,
    fit: &'a Fit,
    all: WindowTerms,
    base: Vec<usize>,
    /// `None` if the equations do not determine the base.
    eliminated: Option<Eliminated>,
}

impl<'a> LeastCost<'a> {
    fn of(dynamics: &'a Dynamics, fit: &'a Fit, base: Vec<usize>) -> Self {
        let all = fit.equations_and_prior();
        let base = not_at_bounds(dynamics, fit, &all, base);
        Self {
            eliminated: Eliminated::ridged(&all.hessian, &base),
            dynamics,
            fit,
            all,
            base,
        }
    }

    /// The change of the cost with more free values.
    fn with(&self, more: Vec<usize>) -> Option<f64> {
        let step = |free: &[usize]| match free.strip_prefix(self.base.as_slice()) {
            Some(more) => {
                let step = self.eliminated.as_ref()?.solve(more, &self.all.gradient)?;
                Some(-step.select_rows(free))
            }
            None => Some(-solve_among(&self.all, free)?),
        };
        let all = [self.base.as_slice(), &more].concat();
        let (free, step) = step_from_bounds(self.dynamics, self.fit, all, step)?;
        Some(0.5 * self.all.gradient.select_rows(&free).dot(&step))
    }
}

/// The same effects with names of their own, so that one model can have all of them.
pub(super) fn numbered(mut effects: Vec<FittedEffect>) -> Vec<FittedEffect> {
    for (number, effect) in effects.iter_mut().enumerate() {
        effect.effect.name = format!("{} {number}", effect.effect.name);
    }
    effects
}

/// The parameters of a model, counted among all, that switch one of its effects off at zero.
pub fn switches(model: &Model) -> HashSet<usize> {
    let placed = |k: usize| model.place_of(k).zip(&model.effects[k].effect.parameters);
    let all = (0..model.effects.len()).flat_map(placed);
    let switches = all.filter(|(_, parameter)| parameter.is_switch());
    switches.map(|(k, _)| k).collect()
}

/// Whether some parameter value switches the effect off, so that it can start from absent.
pub fn has_switch(candidate: &FittedEffect) -> bool {
    (candidate.effect.parameters.iter()).any(EffectParameter::is_switch)
}
