//! Motions that excite an arm: a few harmonics per joint (Swevers et al. 1997).

use std::f64::consts::TAU;

use rand::{Rng, RngExt};

/// Hz
const BASE: f64 = 0.1;
const HARMONICS: usize = 6;

/// Amplitude (rad), angular frequency (rad/s) and phase of each joint's harmonics, and the angle about which they move.
pub(super) struct Motion(Vec<(f64, Vec<[f64; 3]>)>);

impl Motion {
    pub fn draw(amplitude: &[f64], rng: &mut impl Rng) -> Self {
        let joint = |largest: &f64| {
            let shares: Vec<f64> = (0..HARMONICS).map(|_| rng.random_range(0.2..1.0)).collect();
            let sum: f64 = shares.iter().sum();
            let wave = |(k, share): (usize, f64)| {
                let frequency = TAU * BASE * (k + 1) as f64;
                [largest * share / sum, frequency, rng.random_range(0.0..TAU)]
            };
            let waves: Vec<[f64; 3]> = shares.into_iter().enumerate().map(wave).collect();
            (rng.random_range(-0.5..0.5) * largest, waves)
        };
        Self(amplitude.iter().map(joint).collect())
    }

    /// Angles, velocities and accelerations at a time (s).
    pub fn at(&self, time: f64) -> [Vec<f64>; 3] {
        let sum = |wave: &dyn Fn(&[f64; 3]) -> f64, about: f64| -> Vec<f64> {
            let joints = self.0.iter();
            joints
                .map(|(middle, waves)| about * middle + waves.iter().map(wave).sum::<f64>())
                .collect()
        };
        [
            sum(&|[a, w, p]| a * (w * time + p).sin(), 1.0),
            sum(&|[a, w, p]| a * w * (w * time + p).cos(), 0.0),
            sum(&|[a, w, p]| -a * w * w * (w * time + p).sin(), 0.0),
        ]
    }
}
