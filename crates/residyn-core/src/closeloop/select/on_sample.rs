use rayon::prelude::*;

use super::trial::is_consistent;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::identify::{LevenbergMarquardt, fit_below};
use crate::model::{FittedEffect, Model};

/// All starts are taken as far as this many steps of a fit, and the best few of them as far as some more, while they may
/// still do better than what there is.
const FIRST_STEPS: LevenbergMarquardt = at_most(4);
const MORE_STEPS: LevenbergMarquardt = LevenbergMarquardt {
    first_steps: 0,
    ..at_most(10)
};
const FEW: usize = 4;

const fn at_most(most_steps: usize) -> LevenbergMarquardt {
    LevenbergMarquardt {
        most_steps,
        ..LevenbergMarquardt::USUAL
    }
}

/// A model with a candidate more, at the values with the lowest cost over the sample of windows that fits from these starts
/// lead to; `None` if that is not below `below`.
pub fn fitted_on_sample(
    problem: &Problem<'_>,
    fitted: &Fitted,
    starts: Vec<FittedEffect>,
    below: f64,
) -> Option<Fitted> {
    let scale = fitted.fit.scale;
    let states = problem.sample.start_states(&fitted.fit.start_states);
    let begin = |start: FittedEffect| {
        let model = fitted.model.with_effects(fitted.effects_and(&[start]));
        moved(
            problem,
            &FIRST_STEPS,
            &model,
            &states,
            (scale, f64::INFINITY),
        )
    };
    let end = |Fitted { model, fit }| {
        moved(
            problem,
            &MORE_STEPS,
            &model,
            &fit.start_states,
            (scale, below),
        )
    };
    let mut begun = by_cost(starts.into_par_iter().filter_map(begin).collect());
    // Where nothing shows a difference, as that of the side of a friction that the model does not have.
    begun.dedup_by(|a, b| a.fit.cost == b.fit.cost);
    begun.truncate(FEW);
    let ended = by_cost(begun.into_par_iter().filter_map(end).collect());
    let last = |found: &Fitted| found.model.effects.last().cloned();
    let is_of_use = |found: &Fitted| {
        found.fit.cost < below && last(found).is_some_and(|effect| is_consistent(&effect))
    };
    ended.into_iter().find(is_of_use)
}

/// The cost over the sample of windows of a model with its values free. It is infinite if torques are compared: a
/// linearisation predicts what effects do to them, and nothing is fitted to the sample.
pub fn cost_on_sample(problem: &Problem<'_>, fitted: &Fitted) -> Option<f64> {
    if problem.error_model == ErrorModel::InverseDynamics {
        return Some(f64::INFINITY);
    }
    let states = problem.sample.start_states(&fitted.fit.start_states);
    let aim = (fitted.fit.scale, f64::INFINITY);
    let moved = moved(problem, &MORE_STEPS, &fitted.model, &states, aim)?;
    Some(moved.fit.cost)
}

/// A model after some steps of a fit to the sample of windows, at this scale of the residuals and with this cost in view.
fn moved(
    problem: &Problem<'_>,
    solver: &LevenbergMarquardt,
    model: &Model,
    start_states: &[Vec<f64>],
    aim: (f64, f64),
) -> Option<Fitted> {
    let (shooting, states) = (&problem.sample.shooting, start_states.to_vec());
    let found = problem.fitted_by(model, |dynamics, active| {
        let found = fit_below(solver, shooting, dynamics, active, states, aim);
        found.ok().flatten().ok_or(())
    });
    found.ok()
}

fn by_cost(mut all: Vec<Fitted>) -> Vec<Fitted> {
    all.sort_by(|a, b| a.fit.cost.total_cmp(&b.fit.cost));
    all
}
