//! Where a joint rests, as far as the noise of its angle lets one tell. Dry friction holds a resting joint against any
//! torque up to its level, so that the torque says nothing of the motion there.

use std::f64::consts::{SQRT_2, TAU};

use super::statistics::quantile;

/// Noise alone moves a resting joint faster than this many standard deviations in 0.3 % of the rows.
const DEVIATIONS: f64 = 3.0;
/// This share of a normal sample lies within 1.645 standard deviations; spikes are fewer than the rest.
const INNER: (f64, f64) = (0.9, 1.645);

/// Whether a joint rests at each row: it is no faster than its velocity's noise, for longer than the low pass
/// remembers, which is half a period at the cutoff. A reversal is over sooner. `read` and `passed` are its angle at even
/// steps before and after the low pass, `speeds` its velocity in angles a step, `cutoff` a share of the sampling rate.
pub(super) fn rests(read: &[f64], passed: &[f64], speeds: &[f64], cutoff: f64) -> Vec<bool> {
    let limit = DEVIATIONS * noise(read, passed) * of_speed(cutoff);
    let is_slow = |speed: f64| speed.abs() <= limit;
    let remembered = 0.5 / cutoff;
    let runs = speeds.chunk_by(|a, b| is_slow(*a) == is_slow(*b));
    let of_run = |run: &[f64]| vec![is_slow(run[0]) && run.len() as f64 > remembered; run.len()];
    runs.flat_map(of_run).collect()
}

/// The noise of an angle: what the low pass takes away from it.
fn noise(read: &[f64], passed: &[f64]) -> f64 {
    let removed = read
        .iter()
        .zip(passed)
        .map(|(read, passed)| (read - passed).abs());
    let (share, deviations) = INNER;
    quantile(&removed.collect::<Vec<f64>>(), share) / deviations
}

/// The noise of the velocity after an ideal low pass, in angles a step, for white noise of one on the angle: the root of
/// the integral of (2 pi f)^2 over the frequencies that pass.
fn of_speed(cutoff: f64) -> f64 {
    TAU * SQRT_2 * cutoff * (cutoff / 3.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::rests;
    use crate::data::low_pass::LowPass;

    const CUTOFF: f64 = 0.05;

    /// Of an angle with a pseudo-random noise of this size.
    fn resting(angle: impl Fn(f64) -> f64, noise: f64) -> Vec<bool> {
        let mut state = 1u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 32) as f64 / f64::from(u32::MAX) - 0.5
        };
        let read: Vec<f64> = (0..4000)
            .map(|row| angle(f64::from(row)) + 12.0_f64.sqrt() * noise * uniform())
            .collect();
        let passed = LowPass::new(CUTOFF).apply(&read);
        let speeds = crate::data::smooth::central_differences(&passed);
        rests(&read, &passed, &speeds, CUTOFF)
    }

    fn share(rests: &[bool]) -> f64 {
        rests.iter().filter(|rests| **rests).count() as f64 / rests.len() as f64
    }

    #[test]
    fn a_joint_rests_where_noise_alone_moves_it_and_not_where_it_reverses() {
        for noise in [0.0, 1e-5, 1e-4] {
            let still = resting(|_| 0.3, noise);
            assert!(share(&still) > 0.9, "{noise}: {}", share(&still));
            let swings = resting(|row| (0.01 * row).sin(), noise);
            assert_eq!(share(&swings), 0.0, "{noise}");
            let stops = resting(|row| 1e-2 * row.min(2000.0), noise);
            assert!(!stops[..1950].contains(&true), "{noise}");
            assert!(share(&stops[2050..]) > 0.9, "{noise}");
        }
    }
}
