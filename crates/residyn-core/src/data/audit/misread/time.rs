//! Time in a unit other than seconds.

use super::{Change, Misread, Reading, To};
use crate::data::audit::table::short;
use crate::data::column::Quantity;

/// Longest and shortest plausible step \[s\]: rigs that are worth a model are logged at 5 Hz to 50 kHz.
const LONGEST_STEP_S: f64 = 0.2;
const SHORTEST_STEP_S: f64 = 2e-5;

/// Logged speeds over the derivative of the angles count as 1, apart from the unit of time, within this share.
const SAME: f64 = 0.2;

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    let step_s = reading.log.median_step();
    if step_s <= LONGEST_STEP_S {
        return vec![];
    }
    let is_plausible = |size: f64| (SHORTEST_STEP_S..=LONGEST_STEP_S).contains(&(step_s * size));
    let units = Quantity::Time.units().iter();
    let mut fitting = units.filter(|(_, size)| is_plausible(*size));
    // Speeds in rad/s show which.
    let shown = fitting
        .clone()
        .find(|(_, size)| speeds_agree(reading, *size));
    let Some(&(unit, _)) = shown.or_else(|| fitting.next()) else {
        return vec![];
    };
    let speeds = shown.map(|(_, size)| {
        let times = short(1.0 / size);
        format!(", and logged velocities are {times} times the derivative of the angles")
    });
    let speeds = speeds.unwrap_or_default();
    vec![Misread {
        joint: None,
        text: format!(
            "the median step is {} s, {} rows last {} s{speeds}: the time looks like {unit}",
            short(step_s),
            reading.log.rows(),
            short(reading.log.duration())
        ),
        changes: vec![Change {
            quantity: Quantity::Time,
            joint: None,
            to: To::Unit(unit),
        }],
    }]
}

/// Whether all velocities would be derivatives of their angles if the unit of time were this many seconds; false if
/// none can be compared.
fn speeds_agree(reading: &Reading<'_>, size: f64) -> bool {
    let checks: Vec<f64> = reading
        .joints
        .iter()
        .filter_map(|joint| Some(joint.velocity?.scale))
        .collect();
    !checks.is_empty() && checks.iter().all(|scale| (scale * size - 1.0).abs() < SAME)
}
