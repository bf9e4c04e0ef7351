use rayon::prelude::*;

use super::trial::is_consistent;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::identify::{Led, LevenbergMarquardt, led_below};
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

/// A model on its way to the minimum over the sample of windows.
struct OnItsWay {
    model: Model,
    start_states: Vec<Vec<f64>>,
    cost: f64,
}

/// A model with a candidate more, at the values with the lowest cost over the sample of windows that fits from these starts
/// lead to; `None` if that is not below `below`.
pub fn fitted_on_sample(
    problem: &Problem<'_>,
    fitted: &Fitted,
    starts: Vec<FittedEffect>,
    below: f64,
) -> Option<Model> {
    let scale = fitted.fit.scale;
    let start_states = problem.sample.start_states(&fitted.fit.start_states);
    let begin = |start: FittedEffect| OnItsWay {
        model: fitted.model.with_effects(fitted.effects_and(&[start])),
        start_states: start_states.clone(),
        cost: f64::INFINITY,
    };
    let further = |all: Vec<OnItsWay>, solver: &LevenbergMarquardt, below: f64| {
        let led = (all.into_par_iter()).filter_map(|one| one.led(problem, solver, (scale, below)));
        by_cost(led.collect())
    };
    let all = starts.into_iter().map(begin).collect();
    let mut begun = further(all, &FIRST_STEPS, f64::INFINITY);
    // Where nothing shows a difference, as that of the side of a friction that the model does not have.
    begun.dedup_by(|a, b| a.cost == b.cost);
    begun.truncate(FEW);
    let ended = further(begun, &MORE_STEPS, below);
    let is_of_use = |found: &OnItsWay| {
        found.cost < below && found.model.effects.last().is_some_and(is_consistent)
    };
    Some(ended.into_iter().find(is_of_use)?.model)
}

/// The cost over the sample of windows of a model with its values free. It is infinite if torques are compared: a
/// linearisation predicts what effects do to them, and nothing is fitted to the sample.
pub fn cost_on_sample(problem: &Problem<'_>, fitted: &Fitted) -> Option<f64> {
    if problem.error_model == ErrorModel::InverseDynamics {
        return Some(f64::INFINITY);
    }
    let begin = OnItsWay {
        model: fitted.model.clone(),
        start_states: problem.sample.start_states(&fitted.fit.start_states),
        cost: f64::INFINITY,
    };
    let aim = (fitted.fit.scale, f64::INFINITY);
    Some(begin.led(problem, &MORE_STEPS, aim)?.cost)
}

impl OnItsWay {
    /// The same after some steps of a fit to the sample of windows, at this scale of the residuals and with this cost in
    /// view.
    fn led(
        self,
        problem: &Problem<'_>,
        solver: &LevenbergMarquardt,
        aim: (f64, f64),
    ) -> Option<Self> {
        let model = problem.smoothed(&self.model);
        let dynamics = problem.error_model.compile(&model);
        let (shooting, active) = (&problem.sample.shooting, problem.active(&dynamics));
        let led = led_below(solver, shooting, &dynamics, &active, self.start_states, aim);
        let Led {
            values,
            start_states,
            cost,
        } = led.ok()??;
        Some(Self {
            model: model.at(&values.put_into(&dynamics, problem.logs)),
            start_states,
            cost,
        })
    }
}

fn by_cost(mut all: Vec<OnItsWay>) -> Vec<OnItsWay> {
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    all
}
