use std::f64::consts::TAU;

use rand::{Rng, RngExt};

/// A multisine with random phases: one frequency in each of equally wide slices of the band on a logarithmic scale.
#[derive(Debug, Clone)]
pub struct Multisine {
    /// Amplitude, angular frequency \[rad/s\], phase \[rad\].
    tones: Vec<[f64; 3]>,
}

/// Number of sines.
const TONES: u32 = 7;

impl Multisine {
    /// With root mean square `size`, between two frequencies \[Hz\].
    pub fn draw(size: f64, [low, high]: [f64; 2], rng: &mut impl Rng) -> Self {
        let amplitude = size * (2.0 / f64::from(TONES)).sqrt();
        let tone = |k: u32| {
            let place = (f64::from(k) + rng.random::<f64>()) / f64::from(TONES);
            let frequency = low * (high / low).powf(place);
            [amplitude, TAU * frequency, TAU * rng.random::<f64>()]
        };
        Self {
            tones: (0..TONES).map(tone).collect(),
        }
    }

    pub fn at(&self, time: f64) -> f64 {
        let tones = self.tones.iter();
        tones.map(|[a, w, p]| a * (w * time + p).sin()).sum()
    }

    /// Time derivative.
    pub fn rate(&self, time: f64) -> f64 {
        let tones = self.tones.iter();
        tones.map(|[a, w, p]| a * w * (w * time + p).cos()).sum()
    }
}

/// The position controller of a simple rig: a PD controller that sees the measured angle alone.
#[derive(Debug, Clone)]
pub struct Controller {
    /// \[N m/rad\]
    pub stiffness: f64,
    /// \[N m s/rad\]
    pub damping: f64,
    /// Largest torque that it commands \[N m\].
    pub limit: f64,
    previous: Option<f64>,
    speed: f64,
}

/// Time constant of the filter behind the difference quotient \[s\].
const FILTER_S: f64 = 0.01;

impl Controller {
    pub fn new(stiffness: f64, damping: f64, limit: f64) -> Self {
        Self {
            stiffness,
            damping,
            limit,
            previous: None,
            speed: 0.0,
        }
    }

    /// The command \[N m\] for an angle measured `dt` s after the previous one, given the reference angle and speed.
    pub fn command(&mut self, measured: f64, [angle, speed]: [f64; 2], dt: f64) -> f64 {
        let raw = (measured - self.previous.unwrap_or(measured)) / dt;
        self.previous = Some(measured);
        self.speed += (raw - self.speed) * dt / (FILTER_S + dt);
        let torque = self.stiffness * (angle - measured) + self.damping * (speed - self.speed);
        torque.clamp(-self.limit, self.limit)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Controller, Multisine};

    #[test]
    fn a_multisine_has_the_size_and_the_slope_asked_for() {
        let sine = Multisine::draw(2.0, [0.5, 3.0], &mut ChaCha8Rng::seed_from_u64(4));
        let samples = 200_000;
        let at = |k: i32| sine.at(0.001 * f64::from(k));
        let mean_square = (0..samples).map(|k| at(k).powi(2)).sum::<f64>() / f64::from(samples);
        assert!((mean_square.sqrt() - 2.0).abs() < 0.02, "{mean_square}");
        let slope = (sine.at(1.0 + 1e-6) - sine.at(1.0 - 1e-6)) / 2e-6;
        assert!((sine.rate(1.0) - slope).abs() < 1e-6);
    }

    #[test]
    fn a_controller_pushes_towards_the_reference_within_its_limit() {
        let mut controller = Controller::new(10.0, 1.0, 3.0);
        assert_eq!(controller.command(0.0, [0.1, 0.0], 0.01), 1.0);
        // 0.2 rad on in 10 ms: half of 20 rad/s has passed the filter.
        let braking: f64 = 10.0 * (0.1 - 0.2) - 10.0;
        assert_eq!(controller.command(0.2, [0.1, 0.0], 0.01), braking.max(-3.0));
    }
}
