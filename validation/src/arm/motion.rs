//! Motions that excite an arm: a few harmonics per joint (Swevers et al. 1997).

use std::f64::consts::TAU;

use rand::{Rng, RngExt};

use crate::excitation::Multisine;

/// Hz
const BASE: f64 = 0.1;
const HARMONICS: usize = 6;

/// The angle (rad) about which each joint moves, and its harmonics.
pub(super) struct Motion(Vec<(f64, Multisine)>);

impl Motion {
    pub fn draw(amplitude: &[f64], rng: &mut impl Rng) -> Self {
        let joint = |largest: &f64| {
            let shares: Vec<f64> = (0..HARMONICS).map(|_| rng.random_range(0.2..1.0)).collect();
            let sum: f64 = shares.iter().sum();
            let wave = |(k, share): (usize, f64)| {
                let frequency = TAU * BASE * (k + 1) as f64;
                [largest * share / sum, frequency, rng.random_range(0.0..TAU)]
            };
            let waves = Multisine(shares.into_iter().enumerate().map(wave).collect());
            (rng.random_range(-0.5..0.5) * largest, waves)
        };
        Self(amplitude.iter().map(joint).collect())
    }

    /// Angles, velocities and accelerations at a time (s).
    pub fn at(&self, time: f64) -> [Vec<f64>; 3] {
        let joints = || self.0.iter();
        [
            joints().map(|(middle, w)| middle + w.at(time)).collect(),
            joints().map(|(_, waves)| waves.rate(time)).collect(),
            joints()
                .map(|(_, waves)| waves.acceleration(time))
                .collect(),
        ]
    }
}
