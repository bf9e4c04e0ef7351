use std::f64::consts::TAU;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// The torques or commands that excite a plant: a multisine of equal amplitudes whose phases are drawn anew for each log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excitation {
    /// Size per joint, for a torque in N m (or N): each of k sines has this amplitude divided by the root of k.
    pub amplitude: Vec<f64>,
    /// Lowest and highest frequency in Hz.
    pub band_hz: [f64; 2],
    /// Number of sines.
    pub tones: usize,
}

/// One draw: amplitude, angular frequency and phase, `[joint][tone]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tones(Vec<Vec<[f64; 3]>>);

impl Excitation {
    /// Of a desktop rig, with an amplitude of 1 on each joint.
    pub fn usual(joints: usize) -> Self {
        Self {
            amplitude: vec![1.0; joints],
            band_hz: [0.1, 2.0],
            tones: 8,
        }
    }

    /// Draw frequencies and phases.
    pub fn draw(&self, rng: &mut impl Rng) -> Tones {
        let [low, high] = self.band_hz;
        #[allow(clippy::cast_precision_loss)] // few tones
        let count = self.tones.max(1) as f64;
        let mut tones = |amplitude: f64| {
            (0..self.tones)
                .map(|k| {
                    // One tone in each of equal slices of the band on a logarithmic scale, so that draws differ
                    // in frequency as well as in phase.
                    #[allow(clippy::cast_precision_loss)]
                    let place = (k as f64 + rng.random::<f64>()) / count;
                    let frequency = low * (high / low).powf(place);
                    let phase = TAU * rng.random::<f64>();
                    [amplitude / count.sqrt(), TAU * frequency, phase]
                })
                .collect()
        };
        let amplitudes = self.amplitude.iter();
        Tones(amplitudes.map(|amplitude| tones(*amplitude)).collect())
    }
}

impl Tones {
    /// The torque of each joint at `time` (s).
    pub fn at(&self, time: f64) -> Vec<f64> {
        let sum =
            |tones: &Vec<[f64; 3]>| tones.iter().map(|[a, w, p]| a * (w * time + p).sin()).sum();
        self.0.iter().map(sum).collect()
    }
}
