use serde::{Serialize, Serializer};

use crate::model::CommandFilter;

use super::Portable;
use crate::data::Joint;

/// What the filters of one joint make of torques that are held over equal steps. They are linear: everything is a sum
/// of what the lag has come to and of two of the torques commanded so far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldFilter {
    /// Written as the place in a list of torques, from 0: that is how readers of a step use it.
    #[serde(serialize_with = "as_index")]
    pub joint: Joint,
    /// How many earlier torques matter; the last of them is the one that acts first.
    pub past: usize,
    /// Where in `[torque of this step, earlier ones, the newest first]` the torques stand that act when the step begins
    /// and that then take their place.
    pub places: [usize; 2],
    /// Whether the joint's lag is part of the memory.
    pub lags: bool,
    /// The mean torque over each equal part of a step.
    pub mean: Vec<Sum>,
    /// What the lag has come to at the end of the step.
    pub end: Sum,
}

/// Factors of a sum.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sum {
    /// Of the lag at the start of the step.
    pub lagged: f64,
    /// Of the torque that acts, by the delay, when the step begins.
    pub first: f64,
    /// Of the torque that takes its place within the step.
    pub then: f64,
}

/// Below this share of a step the rest of a delay is the rounding of a quotient.
const LEAST_REST: f64 = 1e-9;

impl HeldFilter {
    /// The filters of a model, one for each joint that has any.
    pub fn all(model: &Portable) -> Vec<Self> {
        let of_joint = |joint: Joint| {
            let delay = model.filter(joint, CommandFilter::Delay);
            let lag = model.filter(joint, CommandFilter::Lag);
            (delay.is_some() || lag.is_some()).then(|| {
                let delay = delay.unwrap_or(0.0);
                Self::new(joint, delay, lag, model.step_s, model.integrator.parts())
            })
        };
        Joint::all(model.joints()).filter_map(of_joint).collect()
    }

    fn new(joint: Joint, delay: f64, lag: Option<f64>, step_s: f64, parts: usize) -> Self {
        let (whole, rest) = split(delay / step_s);
        let change = rest * step_s;
        // What the lag has come to, as the step goes on.
        let mut now = Sum {
            lagged: 1.0,
            ..Sum::default()
        };
        let mut mean = Vec::with_capacity(parts);
        for part in 0..parts {
            let ends = [part, part + 1].map(|k| step_s * k as f64 / parts as f64);
            let middle = change.clamp(ends[0], ends[1]);
            let mut sum = Sum::default();
            for (from, to, command) in [
                (
                    ends[0],
                    middle,
                    Sum {
                        first: 1.0,
                        ..Sum::default()
                    },
                ),
                (
                    middle,
                    ends[1],
                    Sum {
                        then: 1.0,
                        ..Sum::default()
                    },
                ),
            ] {
                let (over, end) = now.held(command, lag.unwrap_or(0.0), to - from);
                sum = sum.plus(over, (to - from) / (ends[1] - ends[0]));
                now = end;
            }
            mean.push(sum);
        }
        let past = whole + usize::from(rest > 0.0);
        Self {
            joint,
            past,
            places: [past, whole],
            lags: lag.is_some(),
            mean,
            end: now,
        }
    }

    /// Numbers that the memory holds: earlier torques, the newest first, then the lag.
    pub fn memory(&self) -> usize {
        self.past + usize::from(self.lags)
    }
}

/// Whole steps, and the share of one that is left.
fn split(steps: f64) -> (usize, f64) {
    let whole = (steps + LEAST_REST).floor();
    let rest = (steps - whole).max(0.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a delay is not negative
    let whole = whole as usize;
    (whole, if rest < LEAST_REST { 0.0 } else { rest })
}

fn as_index<S: Serializer>(joint: &Joint, serializer: S) -> Result<S::Ok, S::Error> {
    joint.index().serialize(serializer)
}

impl Serialize for Sum {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        [self.lagged, self.first, self.then].serialize(serializer)
    }
}

impl Sum {
    fn plus(self, other: Self, factor: f64) -> Self {
        Self {
            lagged: self.lagged + factor * other.lagged,
            first: self.first + factor * other.first,
            then: self.then + factor * other.then,
        }
    }

    /// Mean and end of T dx/dt + x = `command` over `length`, from x = self.
    fn held(self, command: Self, lag: f64, length: f64) -> (Self, Self) {
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
    use super::HeldFilter;
    use crate::data::Joint;

    #[test]
    fn a_delay_of_whole_steps_is_an_earlier_torque() {
        for (delay, past) in [(0.0, 0), (0.04, 2), (0.06, 3)] {
            let filter = HeldFilter::new(Joint::at(0), delay, None, 0.02, 2);
            assert_eq!((filter.past, filter.places), (past, [past, past]));
            assert!(filter.mean.iter().all(|sum| (sum.then - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn a_torque_takes_its_place_within_the_step() {
        let filter = HeldFilter::new(Joint::at(0), 0.025, None, 0.02, 1);
        assert_eq!((filter.past, filter.places), (2, [2, 1]));
        let mean = filter.mean[0];
        assert!((mean.first - 0.25).abs() < 1e-12 && (mean.then - 0.75).abs() < 1e-12);
    }

    #[test]
    fn factors_of_a_constant_torque_come_to_one() {
        let filter = HeldFilter::new(Joint::at(0), 0.03, Some(0.05), 0.02, 3);
        for sum in filter.mean.iter().chain([&filter.end]) {
            assert!(
                (sum.lagged + sum.first + sum.then - 1.0).abs() < 1e-12,
                "{sum:?}"
            );
        }
        assert!((filter.end.lagged - (-0.4_f64).exp()).abs() < 1e-12);
    }
}
