//! The audit of one column of a log on its own.

use serde::Serialize;

use crate::data::examined::at_examined;
use crate::data::signal::{noise_std, resolution};
use crate::data::statistics::ends;

/// One column of a log: what its numbers look like, in the column's own unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// Standard name, such as `qd1`.
    pub name: String,
    /// Unit of its numbers; empty for a command.
    pub unit: &'static str,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Quantisation step; 0 for a continuous channel.
    pub resolution: f64,
    /// Standard deviation of the white noise. An upper bound if the steps are long relative to the motion; 0 if
    /// quantisation hides the noise.
    pub noise_std: f64,
    /// Rows that jump. For a velocity: rows that disagree with the derivative of the angle. For an angle or a torque:
    /// single rows away from both neighbours, which agree with each other. Rows in which an angle jumps are excluded
    /// from the other numbers.
    pub spikes: usize,
    /// Share of the rows that sit at exactly the smallest or largest value, as at a limit; 0 if the
    /// values merely turn round there, or if the limit is zero.
    pub saturated_fraction: f64,
    /// Whether all values are the same.
    pub constant: bool,
    /// The ends of the range at which values sit.
    #[serde(skip)]
    pub(super) limits: Vec<f64>,
}

impl Channel {
    /// Measures one column with at least one row. `spikes` is counted by the caller, as its meaning
    /// depends on the kind of channel.
    pub(super) fn of(name: String, unit: &'static str, values: &[f64], spikes: usize) -> Self {
        let [min, max] = ends(values);
        let examined = at_examined(values);
        let resolution = resolution(&examined);
        let noise = noise_std(&examined);
        let at = |limit| (limit, saturated_rows(values, limit, max - min, resolution));
        let at_limits = [max, min].map(at);
        let saturated: usize = at_limits.iter().map(|(_, rows)| rows).sum();
        let reached = at_limits.iter().filter(|(_, rows)| *rows > 0);
        Self {
            name,
            unit,
            min,
            max,
            resolution,
            noise_std: if noise < 0.01 * resolution {
                0.0
            } else {
                noise
            },
            spikes,
            saturated_fraction: saturated as f64 / values.len() as f64,
            constant: min == max,
            limits: reached.map(|(limit, _)| *limit).collect(),
        }
    }

    /// Largest minus smallest value.
    pub fn range(&self) -> f64 {
        self.max - self.min
    }
}

/// Rows at a limit (the smallest or largest value), if the channel looks clipped there; else 0.
///
/// More than a few rows have to sit at the limit, and four times as many as close by: a sine that is
/// rounded to steps lingers at its top as well, but at most 2.4 times as long as in the step below.
fn saturated_rows(values: &[f64], limit: f64, range: f64, resolution: f64) -> usize {
    // Zero is where an actuator rests, not where it ends.
    if range == 0.0 || limit.abs() <= 1e-3 * range {
        return 0;
    }
    // One step of a quantised channel. A coarse one (bang-bang) has no neighbouring step to compare with.
    let near = (1.5 * resolution).clamp(0.01 * range, 0.2 * range);
    let at = values.iter().filter(|value| **value == limit).count();
    let within = values
        .iter()
        .filter(|value| (**value - limit).abs() <= near)
        .count();
    let few = (values.len() / 500).max(5);
    if at > few && at >= 4 * (within - at) {
        at
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of a sine's rows at its limits, after a change of its values.
    fn saturated(change: impl Fn(f64) -> f64) -> f64 {
        let values: Vec<f64> = (0..5000)
            .map(|i| change((f64::from(i) * 0.01).sin()))
            .collect();
        Channel::of("tau1".to_owned(), "N m", &values, 0).saturated_fraction
    }

    #[test]
    fn clipping_is_distinguished_from_reversal() {
        assert_eq!(saturated(|value| value), 0.0);
        // |sin| > 0.8 for 1 - 2 asin(0.8) / pi = 41 % of the time.
        assert!((saturated(|value| value.clamp(-0.8, 0.8)) - 0.41).abs() < 0.01);
        for step in [0.0088, 0.05, 0.13] {
            assert_eq!(
                saturated(|value| (value / step).round() * step),
                0.0,
                "{step}"
            );
        }
    }

    #[test]
    fn bang_bang_is_saturated_and_rest_is_not() {
        assert!(saturated(|value| 0.9 * value.signum()) > 0.99);
        assert_eq!(saturated(|value| value.max(0.0)), 0.0);
        assert_eq!(saturated(|_| 2.0), 0.0);
    }
}
