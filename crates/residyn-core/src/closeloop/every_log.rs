//! Whether an effect makes every log fit better. An effect that fits best overall may imitate a part of another effect,
//! and then it helps on one log and harms on the next.

use super::establish::Standing;
use super::fitted::Fitted;
use super::problem::Problem;
use super::select::is_worse;
use super::settings::Settings;
use crate::data::Log;
use crate::identify::Values;
use crate::sim::metric::{errors_in, windows};

/// Torque errors of a model on each of some logs.
pub(super) struct EveryLog<'l> {
    logs: Vec<OneLog<'l>>,
    /// Sums of squares, log by log, one per joint.
    squares: Vec<Vec<f64>>,
}

/// A log, as fits compare it: without the rows around those that its logger dropped.
struct OneLog<'l> {
    log: &'l Log,
    problem: Problem<'l>,
}

impl<'l> EveryLog<'l> {
    pub fn of(problem: &Problem<'l>, logs: impl Iterator<Item = &'l Log>, model: &Fitted) -> Self {
        let one = |log| OneLog {
            log,
            problem: problem.on(std::slice::from_ref(log)),
        };
        let logs: Vec<OneLog<'l>> = logs.map(one).collect();
        Self {
            squares: logs.iter().map(|log| log.squares(model)).collect(),
            logs,
        }
    }

    /// The first log whose torques, on the joints of an effect, the model fits no better than the model without the
    /// effect. Neither is fitted here. A log in which these joints rest says nothing.
    pub fn fits_as_well_without(&self, standing: &Standing) -> Option<&'l Log> {
        let without = standing.without.as_ref().ok()?;
        let joints = standing.effect.joints();
        let of_effect = |squares: &[f64]| -> f64 { joints.iter().map(|j| squares[*j]).sum() };
        let helps = |(log, with): &(&OneLog<'l>, &Vec<f64>)| {
            let [with, without] = [with, &log.squares(without)].map(|squares| of_effect(squares));
            with < without || without == 0.0
        };
        let found = self
            .logs
            .iter()
            .zip(&self.squares)
            .find(|of_log| !helps(of_log));
        found.map(|(log, _)| log.log)
    }
}

impl OneLog<'_> {
    fn squares(&self, model: &Fitted) -> Vec<f64> {
        let (problem, joints) = (&self.problem, self.problem.declared.joints);
        let (dynamics, shooting) = (problem.compiled(&model.model), &problem.shooting);
        let values = Values::of(&dynamics, problem.logs);
        let left = shooting.residuals(&dynamics, &values, &shooting.initial_start_states(0));
        let left = left.concat();
        let of_joint = |joint| {
            left.iter()
                .skip(joint)
                .step_by(joints)
                .map(|left| left * left)
                .sum()
        };
        (0..joints).map(of_joint).collect()
    }
}

/// Open-loop errors of a model on logs to which nothing is fitted.
pub(super) struct SetApart {
    /// Squares of each window of the middle horizon, all joints together, log by log.
    squares: Vec<Vec<f64>>,
}

impl SetApart {
    pub fn of(problem: &Problem<'_>, fitted: &Fitted, logs: &[Log]) -> Self {
        let dynamics = fitted.model.dynamics();
        let (horizon_s, steps) = (problem.settings.score.middle_s(), problem.shooting.steps());
        let of_log = |log: &Log| {
            let log = std::slice::from_ref(log);
            let errors = errors_in(&dynamics, log, &windows(0, &log[0], horizon_s), steps);
            errors
                .iter()
                .map(|error| error.position.iter().sum())
                .collect()
        };
        Self {
            squares: logs.iter().map(of_log).collect(),
        }
    }

    /// The first log whose error exceeds another model's by more than chance and rounding.
    pub fn worse_than(&self, other: &Self, settings: &Settings) -> Option<usize> {
        let mut logs = self.squares.iter().zip(&other.squares);
        logs.position(|(own, other)| exceeds(own, other, settings))
    }

    /// Whether the error over all logs exceeds another model's by more than chance and rounding.
    pub fn is_worse_than(&self, other: &Self, settings: &Settings) -> bool {
        exceeds(&self.squares.concat(), &other.squares.concat(), settings)
    }
}

fn exceeds(squares: &[f64], others: &[f64], settings: &Settings) -> bool {
    let chance = settings.establish.worse_standard_errors;
    is_worse(squares, others, chance, settings.select.worse_share)
}
