//! Delay and lag of an actuator, discretised exactly for commands that are held over equal steps.

use serde::{Serialize, Serializer};

use super::ExportModel;
use residyn_core::data::Joint;
use residyn_core::model::CommandFilter;

/// The delay and lag of one joint for steps of fixed length. Both are linear, so the torque that acts is a linear
/// combination of the lagged torque and of two earlier commands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct DiscreteFilter {
    /// Saved as the index into a list of torques, from 0, as readers of a step use it.
    #[serde(serialize_with = "as_index")]
    pub joint: Joint,
    /// Number of earlier commands that matter; the oldest acts first.
    pub past: usize,
    /// Positions, in `[command of this step, earlier ones, newest first]`, of the command that acts when the step begins
    /// and of the one that replaces it.
    pub places: [usize; 2],
    /// Whether the lagged torque is part of the memory.
    pub lags: bool,
    /// The mean torque over each substep, in N m (or N).
    pub mean: Vec<Combination>,
    /// The lagged torque at the end of the step, in N m (or N).
    pub end: Combination,
}

/// Coefficients of a linear combination of torques. Saved as a list, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Combination {
    /// Of the lagged torque at the start of the step.
    pub lagged: f64,
    /// Of the command that acts, after the delay, when the step begins.
    pub first: f64,
    /// Of the command that replaces it within the step.
    pub then: f64,
}

/// A fractional step of delay below this value is rounding.
const ROUNDING: f64 = 1e-9;

impl DiscreteFilter {
    /// The filters of a model, one for each joint that has a delay or a lag.
    pub fn all(model: &ExportModel) -> Vec<Self> {
        let of_joint = |joint: Joint| {
            let delay = model.filter(joint, CommandFilter::Delay);
            let lag = model.filter(joint, CommandFilter::Lag);
            (delay.is_some() || lag.is_some()).then(|| {
                let delay = delay.unwrap_or(0.0);
                Self::new(joint, delay, lag, model.step_s, model.integrator.substeps())
            })
        };
        Joint::all(model.joints()).filter_map(of_joint).collect()
    }

    /// `delay`, `lag` and `step_s` in s.
    fn new(joint: Joint, delay: f64, lag: Option<f64>, step_s: f64, substeps: usize) -> Self {
        let (whole, rest) = whole_and_rest(delay / step_s);
        let change = rest * step_s;
        let mut lagged = Combination::LAGGED;
        let mut mean = Vec::with_capacity(substeps);
        for substep in 0..substeps {
            let [start, end] = [substep, substep + 1].map(|k| step_s * k as f64 / substeps as f64);
            let middle = change.clamp(start, end);
            let mut average = Combination::default();
            for (from, to, command) in [
                (start, middle, Combination::FIRST),
                (middle, end, Combination::THEN),
            ] {
                let (over, at_end) = lagged.after_lag(command, lag.unwrap_or(0.0), to - from);
                average = average.plus(over, (to - from) / (end - start));
                lagged = at_end;
            }
            mean.push(average);
        }
        let past = whole + usize::from(rest > 0.0);
        Self {
            joint,
            past,
            places: [past, whole],
            lags: lag.is_some(),
            mean,
            end: lagged,
        }
    }

    /// Size of the memory: earlier commands, newest first, then the lagged torque.
    pub fn memory(&self) -> usize {
        self.past + usize::from(self.lags)
    }
}

/// Whole steps, and the remaining fraction of a step.
fn whole_and_rest(steps: f64) -> (usize, f64) {
    let whole = (steps + ROUNDING).floor();
    let rest = (steps - whole).max(0.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a delay is not negative
    let whole = whole as usize;
    (whole, if rest < ROUNDING { 0.0 } else { rest })
}

fn as_index<S: Serializer>(joint: &Joint, serializer: S) -> Result<S::Ok, S::Error> {
    joint.index().serialize(serializer)
}

impl Serialize for Combination {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        [self.lagged, self.first, self.then].serialize(serializer)
    }
}

impl Combination {
    const LAGGED: Self = Self::new(1.0, 0.0, 0.0);
    const FIRST: Self = Self::new(0.0, 1.0, 0.0);
    const THEN: Self = Self::new(0.0, 0.0, 1.0);

    const fn new(lagged: f64, first: f64, then: f64) -> Self {
        Self {
            lagged,
            first,
            then,
        }
    }

    fn plus(self, other: Self, factor: f64) -> Self {
        Self {
            lagged: self.lagged + factor * other.lagged,
            first: self.first + factor * other.first,
            then: self.then + factor * other.then,
        }
    }

    /// Mean and end value of x in `lag` dx/dt + x = `command` over `length` (both in s), from x = self.
    fn after_lag(self, command: Self, lag: f64, length: f64) -> (Self, Self) {
        if lag <= 0.0 || length <= 0.0 {
            let end = if length > 0.0 { command } else { self };
            return (command, end);
        }
        let ratio = length / lag;
        let left = (-ratio).exp();
        let difference = self.plus(command, -1.0);
        let mean = command.plus(difference, -(-ratio).exp_m1() / ratio);
        (mean, command.plus(difference, left))
    }
}

#[cfg(test)]
mod tests {
    use super::DiscreteFilter;
    use residyn_core::data::Joint;

    #[test]
    fn a_delay_of_whole_steps_is_an_earlier_command() {
        for (delay, past) in [(0.0, 0), (0.04, 2), (0.06, 3)] {
            let filter = DiscreteFilter::new(Joint::at(0), delay, None, 0.02, 2);
            assert_eq!((filter.past, filter.places), (past, [past, past]));
            assert!(filter.mean.iter().all(|sum| (sum.then - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn a_command_replaces_another_within_the_step() {
        let filter = DiscreteFilter::new(Joint::at(0), 0.025, None, 0.02, 1);
        assert_eq!((filter.past, filter.places), (2, [2, 1]));
        let mean = filter.mean[0];
        assert!((mean.first - 0.25).abs() < 1e-12 && (mean.then - 0.75).abs() < 1e-12);
    }

    #[test]
    fn coefficients_of_a_constant_command_sum_to_one() {
        let filter = DiscreteFilter::new(Joint::at(0), 0.03, Some(0.05), 0.02, 3);
        for sum in filter.mean.iter().chain([&filter.end]) {
            assert!(
                (sum.lagged + sum.first + sum.then - 1.0).abs() < 1e-12,
                "{sum:?}"
            );
        }
        assert!((filter.end.lagged - (-0.4_f64).exp()).abs() < 1e-12);
    }
}
