//! Single readings that jump: a bit lost on a bus, a damaged frame.

use super::examined::at_examined;
use super::signal::resolution;
use super::statistics::{mad, quantile};

/// A jump counts beyond this many median absolute deviations (four standard deviations of normal noise).
pub(super) const JUMP_MADS: f64 = 6.0;

/// A jump below this share of the channel's working range harms no fit, however rare it is.
pub(super) const JUMP_SHARE_OF_RANGE: f64 = 0.05;

/// A jump of fewer quantisation steps than this is rounding.
pub(super) const JUMP_RESOLUTION_STEPS: f64 = 3.0;

/// The rows that jump away from both neighbours while the neighbours agree with each other.
pub(super) fn rows_that_jump(values: &[f64]) -> Vec<usize> {
    let jump = |triple: &[f64]| triple[1] - 0.5 * (triple[0] + triple[2]);
    let examined = at_examined(values);
    let jumps: Vec<f64> = examined.windows(3).map(jump).collect();
    let working_range = quantile(&examined, 0.95) - quantile(&examined, 0.05);
    let floor = (JUMP_MADS * mad(&jumps))
        .max(JUMP_SHARE_OF_RANGE * working_range)
        .max(JUMP_RESOLUTION_STEPS * resolution(&examined));
    let isolated = |triple: &[f64]| {
        let [before, after] = [triple[1] - triple[0], triple[1] - triple[2]];
        let smaller = before.abs().min(after.abs());
        let neighbours_agree = (triple[2] - triple[0]).abs() < 0.5 * smaller;
        before * after > 0.0 && smaller > floor && neighbours_agree
    };
    let triples = values.windows(3).zip(1..);
    triples
        .filter(|(triple, _)| isolated(triple))
        .map(|(_, row)| row)
        .collect()
}

/// Replaces these rows, none of them the first or the last, by values interpolated from the rows around them.
pub(super) fn bridge(time: &[f64], values: &mut [f64], rows: &[usize]) {
    for &row in rows {
        let around = [row.saturating_sub(2), row - 1, row + 1, row + 2];
        values[row] = interpolated(time, values, around, time[row]);
    }
}

/// A channel at a time between four of its rows, by the cubic through them; by the straight line through the inner two
/// if the outer ones are beyond the ends of the log.
pub(super) fn interpolated(time: &[f64], values: &[f64], rows: [usize; 4], at_s: f64) -> f64 {
    let inner = [rows[1], rows[2]];
    let beyond = rows[0] == rows[1] || rows[3] >= time.len();
    let used = if beyond { &inner[..] } else { &rows[..] };
    let weight = |row: usize| -> f64 {
        let others = used.iter().filter(|other| **other != row);
        others
            .map(|&other| (at_s - time[other]) / (time[row] - time[other]))
            .product()
    };
    used.iter().map(|&row| weight(row) * values[row]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine() -> Vec<f64> {
        (0..5000).map(|i| (f64::from(i) * 0.01).sin()).collect()
    }

    #[test]
    fn single_rows_that_jump_are_found_and_steps_are_not() {
        let mut values = sine();
        assert!(rows_that_jump(&values).is_empty());
        values[700] += 0.5;
        values[2000] -= 3.0;
        values.iter_mut().skip(3000).for_each(|value| *value += 2.0);
        assert_eq!(rows_that_jump(&values), [700, 2000]);
        assert!(rows_that_jump(&[1.0, 2.0]).is_empty());
    }

    #[test]
    fn a_row_is_bridged_by_what_is_around_it() {
        let time: Vec<f64> = (0..5000).map(|i| f64::from(i) * 0.01).collect();
        let mut values = sine();
        for row in [1, 700, 4998] {
            values[row] = 50.0;
        }
        bridge(&time, &mut values, &[1, 700, 4998]);
        let off = |row: usize| (values[row] - time[row].sin()).abs();
        // By a straight line h^2 / 2 times the curvature at the ends, by a cubic h^4 / 6.
        assert!(off(700) < 1e-8 && off(1) < 6e-5 && off(4998) < 6e-5);
    }
}
