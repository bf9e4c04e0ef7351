//! Position, velocity and acceleration at a row, from the logged positions around it.
//!
//! Velocities that rigs report are too noisy or too filtered to start a prediction from. A cubic fitted by least
//! squares to the positions on either side has no lag, copes with irregular sampling, and follows accelerations that
//! change over the window.

use std::ops::Range;

use super::instant::{SAME_S, row_after, row_from};
use super::signal::differences;
use super::statistics::median_of;

/// Half width of the window that the fit reads \[s\]: 16 ms, or four median steps of slower logs.
///
/// 16 ms is short relative to the swing of a desk-sized rig and long enough at 500 Hz to average an encoder step of 0.4
/// mrad down to 0.03 rad/s; four steps leave nine rows for four coefficients.
pub fn half_width_s(median_step_s: f64) -> f64 {
    (4.0 * median_step_s).max(0.016)
}

/// Value and derivatives of the fitted cubic at the row it was fitted around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalCubic {
    /// Value, in the channel's unit.
    pub value: f64,
    /// First derivative, in the channel's unit per s.
    pub slope: f64,
    /// Second derivative, in the channel's unit per s^2.
    pub curvature: f64,
    /// Root mean square residual of the cubic; the divisor is the number of values less that of its coefficients.
    pub rms: f64,
}

impl LocalCubic {
    /// The frequency above which the value loses more than 3 dB of what was logged \[Hz\].
    ///
    /// The value is the mean over s = -1..1 with the weight (9 - 15 s^2) / 8, whose transform falls to 0.707 at 3.34
    /// rad per half width: 3.34 / (2 pi) = 0.53.
    pub(super) fn cutoff_hz(half_width_s: f64) -> f64 {
        0.53 / half_width_s
    }

    /// Standard deviation of the slope per standard deviation of white noise on the values \[1/s\],
    /// for about `rows` evenly spread rows within `half_width_s` on either side.
    ///
    /// The slope is that of the Legendre polynomials 1 and 3 at 0, whose least-squares coefficients
    /// have variances 3/n and 7/n: (3 * 1^2 + 7 * (3/2)^2) / n = 18.75 / n.
    pub(crate) fn slope_noise_gain(half_width_s: f64, rows: f64) -> f64 {
        (18.75 / rows).sqrt() / half_width_s
    }

    /// Error of the value and, per half width, of the slope if the values have terms beyond a cubic, per unit of `rms`:
    /// of s^4 = (8 P4 + 20 P2 + 7 P0) / 35 and s^5 = (8 P5 + 28 P3 + 27 P1) / 63 in Legendre polynomials, the cubic
    /// leaves the first term.
    pub(crate) const TRUNCATION: [f64; 2] = [1.1, 6.2];

    /// Standard deviation of the value per standard deviation of white noise on the values, likewise: the Legendre
    /// polynomials 0 and 2 at 0 have coefficients of variance 1/n and 5/n, which gives (1 + 5 / 4) / n.
    pub(crate) fn value_noise_gain(rows: f64) -> f64 {
        (2.25 / rows).sqrt()
    }
}

/// The rows within `half_width_s` on either side of a row.
pub(crate) fn rows_around(time: &[f64], row: usize, half_width_s: f64) -> Range<usize> {
    let centre = time[row];
    row_from(time, centre - half_width_s)..row_after(time, centre + half_width_s)
}

/// Fits a cubic to the values within `half_width_s` on either side of a row.
///
/// `time` \[s\] increases strictly and is as long as `values`. `None` if the log does not reach `half_width_s` to both
/// sides of the row, or has fewer than five rows there (a gap).
pub fn local_cubic(
    time: &[f64],
    values: &[f64],
    row: usize,
    half_width_s: f64,
) -> Option<LocalCubic> {
    let centre = time[row];
    let least = half_width_s - SAME_S;
    if centre - time.first()? < least || time.last()? - centre < least {
        return None;
    }
    let rows = rows_around(time, row, half_width_s);
    if rows.len() < 5 {
        return None;
    }
    // Scaled to -1..1, and relative to the row's own value, the sums keep their digits.
    let point = |i: usize| ((time[i] - centre) / half_width_s, values[i] - values[row]);
    let points = rows.clone().map(point);
    let [c0, c1, c2, c3] = cubic_coefficients(points.clone())?;
    let left = points.map(|(s, y)| (y - (c0 + s * (c1 + s * (c2 + s * c3)))).powi(2));
    #[allow(clippy::cast_precision_loss)] // few rows
    let freedom = (rows.len() - 4) as f64;
    Some(LocalCubic {
        value: values[row] + c0,
        slope: c1 / half_width_s,
        curvature: 2.0 * c2 / (half_width_s * half_width_s),
        rms: (left.sum::<f64>() / freedom).sqrt(),
    })
}

/// The derivative of a channel at every row: the slope of the cubic fitted around it or, if there is none (ends, gaps),
/// the difference of the rows on either side over the time between them. Needs at least two rows.
pub(super) fn slopes(time: &[f64], values: &[f64]) -> Vec<f64> {
    let half_width = half_width_s(median_of(differences(time)));
    let between = |a: usize, b: usize| (values[b] - values[a]) / (time[b] - time[a]);
    let neighbours = |row: usize| between(row.saturating_sub(1), (row + 1).min(time.len() - 1));
    let slope = |row| {
        local_cubic(time, values, row, half_width).map_or_else(|| neighbours(row), |fit| fit.slope)
    };
    (0..time.len()).map(slope).collect()
}

/// Least-squares coefficients of 1, s, s^2, s^3; `None` if the points do not determine them.
fn cubic_coefficients(points: impl Iterator<Item = (f64, f64)>) -> Option<[f64; 4]> {
    let mut moments = [0.0; 7];
    let mut right = [0.0; 4];
    for (s, y) in points {
        let mut power = 1.0;
        for degree in 0..7 {
            moments[degree] += power;
            if degree < 4 {
                right[degree] += power * y;
            }
            power *= s;
        }
    }
    let normal = std::array::from_fn(|i| std::array::from_fn(|j| moments[i + j]));
    solve(normal, right)
}

/// Solves a symmetric positive definite system by elimination, which needs no pivoting there. `None` if the matrix is
/// singular to working precision.
fn solve(mut matrix: [[f64; 4]; 4], mut right: [f64; 4]) -> Option<[f64; 4]> {
    for pivot in 0..4 {
        if matrix[pivot][pivot] <= 1e-12 {
            return None;
        }
        for row in pivot + 1..4 {
            let factor = matrix[row][pivot] / matrix[pivot][pivot];
            let upper = matrix[pivot];
            for column in pivot..4 {
                matrix[row][column] -= factor * upper[column];
            }
            right[row] -= factor * right[pivot];
        }
    }
    for row in (0..4).rev() {
        let known: f64 = (row + 1..4)
            .map(|column| matrix[row][column] * right[column])
            .sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_reproduced_on_irregular_rows() {
        let time: Vec<f64> = (0..60)
            .map(|i| 5.0 + 0.002 * i as f64 + 0.0007 * (i % 3) as f64)
            .collect();
        let at = |t: f64| 3.0 - 2.0 * t + 7.0 * t * t - 40.0 * t.powi(3);
        let values: Vec<f64> = time.iter().map(|t| at(t - 5.0)).collect();
        let found = local_cubic(&time, &values, 30, 0.016).unwrap();
        let t = time[30] - 5.0;
        assert!((found.value - at(t)).abs() < 1e-10);
        assert!((found.slope - (-2.0 + 14.0 * t - 120.0 * t * t)).abs() < 1e-8);
        assert!((found.curvature - (14.0 - 240.0 * t)).abs() < 1e-5);
    }

    #[test]
    fn ends_and_gaps_have_no_fit() {
        let uniform: Vec<f64> = (0..100).map(|i| i as f64 * 0.002).collect();
        let fits = |time: &[f64], row| local_cubic(time, time, row, 0.016).is_some();
        assert!(!fits(&uniform, 7) && fits(&uniform, 8));
        assert!(fits(&uniform, 91) && !fits(&uniform, 92));
        let gap = [0.0, 0.001, 0.5, 1.0, 1.001];
        assert!(!fits(&gap, 2));
        assert!(!fits(&[0.0, 1.0], 0));
    }

    #[test]
    fn a_wave_at_the_cutoff_keeps_seven_tenths() {
        let time: Vec<f64> = (0..401).map(|i| i as f64 * 0.001).collect();
        let omega = std::f64::consts::TAU * LocalCubic::cutoff_hz(0.05);
        let wave: Vec<f64> = time.iter().map(|t| (omega * (t - 0.2)).cos()).collect();
        let kept = local_cubic(&time, &wave, 200, 0.05).unwrap().value;
        assert!((kept - 0.707).abs() < 0.02, "{kept}");
    }

    #[test]
    fn value_and_slope_carry_the_noise_that_is_said() {
        // The response to a unit at each row in turn gives the weights; their norm is the gain.
        let time: Vec<f64> = (0..201).map(|i| i as f64 * 0.001).collect();
        let weights = (0..201).map(|at| {
            let unit: Vec<f64> = (0..201).map(|i| f64::from(u8::from(i == at))).collect();
            local_cubic(&time, &unit, 100, 0.05).unwrap()
        });
        let [value, slope] = weights.fold([0.0, 0.0], |[value, slope], of| {
            [value + of.value.powi(2), slope + of.slope.powi(2)]
        });
        let said = [
            LocalCubic::value_noise_gain(101.0),
            LocalCubic::slope_noise_gain(0.05, 101.0),
        ];
        for (norm, said) in [value, slope].map(f64::sqrt).into_iter().zip(said) {
            assert!((norm / said - 1.0).abs() < 0.05, "{norm} {said}");
        }
    }
}
