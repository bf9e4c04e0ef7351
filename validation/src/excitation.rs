use std::f64::consts::{SQRT_2, TAU};

use rand::{Rng, RngExt};

/// A multisine with random phases: the band is divided into slices of equal width on a logarithmic scale, with one
/// frequency in each.
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

/// A sine whose frequency rises from one end of a band to the other, by the same factor in every second.
#[derive(Debug, Clone)]
pub struct Chirp {
    amplitude: f64,
    /// Angular frequency at the start \[rad/s\], and the rate of its logarithm \[1/s\].
    start: f64,
    growth: f64,
    phase: f64,
}

impl Chirp {
    /// With root mean square `size`, between two frequencies \[Hz\], in `seconds`.
    pub fn draw(size: f64, [low, high]: [f64; 2], seconds: f64, rng: &mut impl Rng) -> Self {
        Self {
            amplitude: size * SQRT_2,
            start: TAU * low,
            growth: (high / low).ln() / seconds,
            phase: TAU * rng.random::<f64>(),
        }
    }

    pub fn at(&self, time: f64) -> f64 {
        let turned = self.start / self.growth * (self.growth * time).exp_m1();
        self.amplitude * (turned + self.phase).sin()
    }
}

/// A value that jumps and stays.
#[derive(Debug, Clone)]
pub struct Steps {
    /// Each value and the time \[s\] until which it holds.
    values: Vec<(f64, f64)>,
}

impl Steps {
    /// With root mean square `size`; each value holds for half a period of a frequency in the band \[Hz\].
    pub fn draw(size: f64, [low, high]: [f64; 2], seconds: f64, rng: &mut impl Rng) -> Self {
        let (mut until, mut values) = (0.0, Vec::new());
        while until <= seconds {
            until += 0.5 / (low * (high / low).powf(rng.random::<f64>()));
            // The root mean square of a uniform distribution is its half-width divided by the root of 3.
            values.push((until, 3.0_f64.sqrt() * size * rng.random_range(-1.0..=1.0)));
        }
        Self { values }
    }

    pub fn at(&self, time: f64) -> f64 {
        let k = self.values.partition_point(|(until, _)| *until <= time);
        self.values[k.min(self.values.len() - 1)].1
    }
}

/// The position controller of a simple rig: a PD controller that sees only the measured angle.
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

/// Time constant of the filter after the difference quotient \[s\].
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

    use super::{Chirp, Controller, Multisine, Steps};

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
    fn a_chirp_and_steps_have_the_size_asked_for() {
        let rng = &mut ChaCha8Rng::seed_from_u64(4);
        let (chirp, steps) = (
            Chirp::draw(2.0, [0.5, 5.0], 1000.0, rng),
            Steps::draw(2.0, [0.5, 5.0], 1000.0, rng),
        );
        let size = |at: &dyn Fn(f64) -> f64| {
            let squares = (0..100_000).map(|k| at(0.01 * f64::from(k)).powi(2));
            (squares.sum::<f64>() / 1e5).sqrt()
        };
        assert!((size(&|t| chirp.at(t)) - 2.0).abs() < 0.05);
        assert!((size(&|t| steps.at(t)) - 2.0).abs() < 0.15);
        // At the end of the band the sine crosses zero ten times a second.
        let signs: Vec<bool> = (0..10_000)
            .map(|k| chirp.at(999.0 + 1e-4 * f64::from(k)) > 0.0)
            .collect();
        let crossings = signs.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!((9..=11).contains(&crossings), "{crossings}");
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
