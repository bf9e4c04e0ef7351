//! Whether an effect makes every log fit better. An effect that fits best overall may imitate a part of another effect,
//! and then it helps on one log and harms on the next.

use super::establish::Standing;
use super::fitted::Fitted;
use super::problem::Problem;
use super::select::is_worse;
use super::settings::Settings;
use crate::data::Log;
use crate::sim::metric::{errors_in, torque_error_with, windows};

/// Torque errors of a model on each of some logs.
pub(super) struct EveryLog<'l> {
    /// Per joint in N m (or N); `None` for a log that is too short.
    errors: Vec<(&'l Log, Option<Vec<f64>>)>,
    /// The joints with dry friction.
    dry: Vec<bool>,
}

impl<'l> EveryLog<'l> {
    pub fn of(logs: impl Iterator<Item = &'l Log>, model: &Fitted) -> Self {
        let dry = model.model.dry_joints();
        Self {
            errors: logs.map(|log| (log, errors(model, log, &dry))).collect(),
            dry,
        }
    }

    /// The first log whose torques, on the joints of an effect, the model fits no better than the model without the
    /// effect. Neither is fitted here. A log in which these joints rest says nothing.
    pub fn fits_as_well_without(&self, standing: &Standing) -> Option<&'l Log> {
        let without = standing.without.as_ref().ok()?;
        let joints = standing.effect.joints();
        let of_effect =
            |rms: &[f64]| -> f64 { joints.iter().map(|joint| rms[*joint].powi(2)).sum() };
        let helps = |(log, with): &&(&Log, Option<Vec<f64>>)| {
            let without = errors(without, log, &self.dry);
            let (Some(with), Some(without)) = (with, without) else {
                return false;
            };
            let [with, without] = [with, &without].map(|rms| of_effect(rms));
            with < without || without == 0.0
        };
        let found = self.errors.iter().find(|of_log| !helps(of_log));
        found.map(|(log, _)| *log)
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
        let (horizon_s, step_s) = (
            problem.settings.score.middle_s(),
            problem.shooting.longest_s(),
        );
        let of_log = |log: &Log| {
            let log = std::slice::from_ref(log);
            let errors = errors_in(&dynamics, log, &windows(0, &log[0], horizon_s), step_s);
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

fn errors(model: &Fitted, log: &Log, dry: &[bool]) -> Option<Vec<f64>> {
    Some(torque_error_with(&model.model, std::slice::from_ref(log), dry)?.rms)
}
