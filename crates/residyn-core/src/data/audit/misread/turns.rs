//! Angles that wrap at each full turn.

use std::f64::consts::TAU;

use super::{Change, Misread, Reading, To};
use crate::data::audit::table::short;
use crate::data::column::Quantity;
use crate::data::signal::differences;
use crate::data::statistics::ends;
use crate::data::{Joint, Log};

/// From one row to the next, a joint turns by at most this share of a turn, or by at most twice its larger neighbouring
/// step within the turn.
const CONTINUES: f64 = 0.1;

/// Rounding of the ends of a turn, as a share of it.
const ROUNDING: f64 = 1e-3;

pub(super) fn misread(reading: &Reading<'_>) -> Vec<Misread> {
    let log: &Log = &reading.log;
    let of_joint = |joint: Joint| {
        let angles = &log.q[joint];
        let passed = |turn| Some((turn, passings(angles, turn)?));
        let (turn, rows) = [TAU, 360.0].into_iter().find_map(passed)?;
        let change = |to| Change::of(joint, Quantity::Angle, to);
        let unit = (turn > TAU).then(|| change(To::Unit("deg")));
        let name = joint.name("q");
        Some(Misread {
            joint: Some(joint),
            text: format!(
                "{name} jumps by a full turn ({}) {} time(s), first at t = {} s, and stays within one turn: it wraps \
                 at the end of a turn, and its full turns must be counted",
                short(turn),
                rows.len(),
                short(log.time[rows[0] + 1])
            ),
            changes: unit.into_iter().chain([change(To::Wrapped)]).collect(),
        })
    };
    let turning = reading.joints.iter().filter(|joint| !joint.slides());
    turning.filter_map(|joint| of_joint(joint.joint)).collect()
}

/// The rows after which an angle passes the end of a turn of this length; `None` if it never does, or does not stay
/// within one turn.
fn passings(angles: &[f64], turn: f64) -> Option<Vec<usize>> {
    let [lowest, highest] = ends(angles);
    if highest - lowest > turn * (1.0 + ROUNDING) {
        return None;
    }
    let steps = differences(angles);
    let short_way = |row: usize| steps[row] - turn * (steps[row] / turn).round();
    let is_long = |row: &usize| steps[*row].abs() > 0.5 * turn;
    let continues = |row: &usize| {
        let close_by = [row.saturating_sub(1), (row + 1).min(steps.len() - 1)];
        let usual = close_by.into_iter().filter(|near| !is_long(near));
        let usual = usual.map(|near| steps[near].abs()).fold(0.0, f64::max);
        short_way(*row).abs() <= (CONTINUES * turn).max(2.0 * usual)
    };
    let rows: Vec<usize> = (0..steps.len()).filter(is_long).collect();
    (!rows.is_empty() && rows.iter().all(continues)).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two turns forwards, one back, with the jitter of an encoder.
    fn turning() -> Vec<f64> {
        let row = |i: i32| {
            let t = f64::from(i) * 0.01;
            4.0 * TAU * (0.5 * t).sin().powi(2) + 0.002 * f64::from((i * 7919) % 3)
        };
        (0..600).map(row).collect()
    }

    #[test]
    fn a_turn_that_starts_anew_is_told_from_one_that_is_counted() {
        let angles = turning();
        assert_eq!(passings(&angles, TAU), None);
        let wrapped = angles.iter().map(|a| (a + 1.0).rem_euclid(TAU) - 1.0);
        let wrapped: Vec<f64> = wrapped.collect();
        assert!(passings(&wrapped, TAU).unwrap().len() >= 6);
        let degrees: Vec<f64> = wrapped.iter().map(|a| a.to_degrees()).collect();
        assert_eq!(passings(&degrees, TAU), None);
        assert!(passings(&degrees, 360.0).is_some());
    }

    #[test]
    fn a_reading_that_jumps_is_no_turn() {
        let mut angles: Vec<f64> = turning().iter().map(|a| a / 6.0).collect();
        angles[300] -= 4.0;
        assert_eq!(passings(&angles, TAU), None);
    }
}
