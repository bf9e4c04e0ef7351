//! Robust statistics of one channel.
//!
//! Medians rather than means throughout: logs of real rigs contain spikes, and a single row must not move a
//! statistic.

use super::instant::ROUNDING;
use super::statistics::{SIGMA_PER_MAD, deviation, mad, median, quantile};

/// With fewer rows, quantisation cannot be distinguished from chance.
const MIN_ROWS_FOR_RESOLUTION: usize = 20;

/// Resampling is refused if it would multiply the number of values by more than this.
const MAX_FILL: f64 = 10.0;

/// Differences of neighbours; one fewer than the values.
pub(super) fn differences(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// The gains of white noise's variance in differences of the second, third and fourth order: sums of squared binomials.
const GAINS: [f64; 3] = [6.0, 20.0, 70.0];

/// Standard deviation of white noise on a smooth channel, in the channel's unit.
///
/// Differences of some order remove any polynomial of lower order over their rows, and amplify white noise by a known
/// factor (von Neumann 1941). The part of the signal that remains with it is least in one of these orders: for steps
/// that are long relative to the motion, the result is an upper bound. 0 for fewer than five rows.
pub(super) fn noise_std(values: &[f64]) -> f64 {
    let mut differenced = differences(values);
    let of_order = |gain: f64| {
        differenced = differences(&differenced);
        inner_deviation(&differenced) / gain.sqrt()
    };
    let each = GAINS.map(of_order);
    each.into_iter().fold(f64::INFINITY, f64::min)
}

/// Values farther from the median than this many deviations are spikes.
const SPIKES: f64 = 4.0;

/// Standard deviation without spikes; 0 for no values. Spikes are detected by the median absolute deviation, which is
/// itself a whole number of steps if the values are rounded.
fn inner_deviation(values: &[f64]) -> f64 {
    let (centre, bound) = (median(values), SPIKES * SIGMA_PER_MAD * mad(values));
    let is_inner = |value: &f64| (value - centre).abs() <= bound;
    let inner: Vec<f64> = values.iter().copied().filter(is_inner).collect();
    match inner.is_empty() {
        true => 0.0,
        false => deviation(&inner),
    }
}

/// The step in which a channel is quantised, in its unit; 0 for a continuous channel.
///
/// A step counts as found when it, its double or its triple makes up at least 5 % of the gaps between
/// neighbouring distinct values, and at least 90 % of the short gaps are whole multiples of it. The
/// first keeps the last printed digit from passing for a quantum, the second refuses steps that merely
/// happen to be small. A log that visits few of its steps may hide them.
pub(super) fn resolution(values: &[f64]) -> f64 {
    if values.len() < MIN_ROWS_FOR_RESOLUTION {
        return 0.0;
    }
    let gaps = distinct_gaps(values);
    // The smallest gap is the quantum, unless an artefact such as a wrapped angle made smaller ones;
    // then the quantum is among the small ones.
    let candidates = [0.0, 0.02, 0.1, 0.3, 0.5].map(|share| quantile(&gaps, share));
    let step = candidates.into_iter().find_map(|near| quantum(&gaps, near));
    step.unwrap_or(0.0)
}

/// Gaps between the sorted distinct values. Closer than 1e-9 of the largest value, values differ by
/// rounding only.
fn distinct_gaps(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let sizes = sorted.iter().map(|value| value.abs());
    let largest = sizes.fold(0.0, f64::max);
    let mut gaps = differences(&sorted);
    gaps.retain(|gap| *gap > 1e-9 * largest);
    gaps
}

/// The quantum that explains the gaps near a given one, if the other gaps agree. Some converters
/// skip levels, so that their commonest gaps are two and three quanta.
fn quantum(gaps: &[f64], near: f64) -> Option<f64> {
    let equal = gaps.iter().filter(|gap| (**gap - near).abs() <= 0.1 * near);
    let (count, sum) = equal.fold((0_usize, 0.0), |(count, sum), gap| (count + 1, sum + gap));
    if count == 0 || (count as f64) < 0.05 * gaps.len() as f64 {
        return None;
    }
    let mean = sum / count as f64;
    let steps = [mean, mean / 2.0, mean / 3.0];
    steps.into_iter().find(|step| are_multiples(gaps, *step))
}

/// Whether at least 90 % of the gaps shorter than 20 steps are whole multiples of the step. Over longer gaps, the error
/// of the step itself would blur the multiples.
fn are_multiples(gaps: &[f64], step: f64) -> bool {
    let steps = gaps.iter().map(|gap| gap / step);
    let short: Vec<f64> = steps.filter(|n| *n < 20.0).collect();
    let is_whole = |n: &&f64| n.round() > 0.0 && (**n - n.round()).abs() < 0.1;
    short.iter().filter(is_whole).count() as f64 >= 0.9 * short.len() as f64
}

/// Linear interpolation of a series at one time \[s\]; `None` outside the series.
pub(super) fn interpolate(time: &[f64], values: &[f64], at_s: f64) -> Option<f64> {
    let after = time.partition_point(|t| *t <= at_s);
    if after == 0 {
        return None;
    }
    let (t0, v0) = (time[after - 1], values[after - 1]);
    if at_s == t0 {
        return Some(v0);
    }
    let (t1, v1) = (time.get(after)?, values.get(after)?);
    Some(v0 + (v1 - v0) * (at_s - t0) / (t1 - t0))
}

/// A series at a uniform step \[s\], linear between its rows. The step has to be positive. Empty for a
/// series that consists mostly of gaps.
pub(super) fn resample(time: &[f64], values: &[f64], step_s: f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (time.first(), time.last()) else {
        return vec![];
    };
    if last - first > MAX_FILL * step_s * time.len() as f64 {
        return vec![];
    }
    // The small addition keeps rounding from dropping the last row of a uniform series.
    let count = ((last - first) / step_s + ROUNDING) as usize + 1;
    let at = |index: usize| (first + index as f64 * step_s).min(*last);
    (0..count)
        .filter_map(|index| interpolate(time, values, at(index)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reproducible noise, uniform in -0.5 to 0.5.
    pub(crate) fn noise(count: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..count).map(|_| next()).collect()
    }

    #[test]
    fn noise_is_measured_on_top_of_motion_and_despite_spikes() {
        let noisy = |(i, noise): (usize, f64)| (i as f64 * 0.01).sin() + 0.1 * noise;
        let mut values: Vec<f64> = noise(4000).into_iter().enumerate().map(noisy).collect();
        (0..40).for_each(|i| values[i * 97] += 50.0);
        // Uniform noise of width 0.1 has a deviation of 0.1 / sqrt(12).
        let found = noise_std(&values);
        assert!((found - 0.0289).abs() < 0.001, "{found}");
        assert_eq!(noise_std(&[1.0, 2.0]), 0.0);
    }

    #[test]
    fn a_fast_motion_is_no_noise() {
        let swing = |i: i32| 1.5 * (0.04 * f64::from(i)).sin();
        let noise = noise(4000);
        let measured = |size: f64| {
            let values = (0..).zip(&noise).map(|(i, noise)| swing(i) + size * noise);
            noise_std(&values.collect::<Vec<f64>>())
        };
        // Its second differences alone are those of a noise of some 5e-4.
        let expected = 1e-4 / 12.0_f64.sqrt();
        assert!(measured(1e-4) < 1.3 * expected && measured(1e-4) > 0.8 * expected);
        assert!(measured(0.0) < 3e-6);
    }

    #[test]
    fn a_quantum_is_found_and_none_is_invented() {
        let step = 191.0 / 65535.0;
        let smooth = |i: usize| 2.0 * (i as f64 * 0.0031).sin() + 0.3;
        let smooth: Vec<f64> = (0..2000).map(smooth).collect();
        let coarse = smooth.iter().map(|value| (value / step).round() * step);
        let coarse: Vec<f64> = coarse.collect();
        assert!((resolution(&coarse) / step - 1.0).abs() < 1e-6);
        let skipping = |i: i32| 0.022 * f64::from(5 * (i / 2) + 2 * (i % 2));
        let skipping: Vec<f64> = (0..300).map(skipping).collect();
        assert!((resolution(&skipping) - 0.022).abs() < 1e-6);
        for continuous in [smooth, noise(5000), vec![1.0; 50], vec![1.0, 2.0]] {
            assert_eq!(resolution(&continuous), 0.0);
        }
    }

    #[test]
    fn a_quantum_survives_an_angle_that_was_wrapped() {
        let step = 0.003;
        let wrapped = |i: usize| {
            let turns = if i < 1000 { 0.0 } else { std::f64::consts::TAU };
            ((i as f64 * 0.004).sin() / step).round() * step + turns - 3.0 * turns.signum()
        };
        let values: Vec<f64> = (0..2000).map(wrapped).collect();
        let found = resolution(&values);
        assert!((found - step).abs() < 1e-5, "{found}");
    }

    #[test]
    fn resampling_keeps_straight_lines_and_ends() {
        let time = [0.0, 0.1, 0.35, 0.4];
        let values = time.map(|t| 2.0 * t + 1.0);
        let uniform = resample(&time, &values, 0.05);
        assert_eq!(uniform.len(), 9);
        for (index, value) in uniform.iter().enumerate() {
            assert!((value - (2.0 * 0.05 * index as f64 + 1.0)).abs() < 1e-12);
        }
        assert_eq!(interpolate(&time, &values, 0.5), None);
        assert_eq!(interpolate(&time, &values, -0.1), None);
    }
}
