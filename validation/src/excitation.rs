use std::f64::consts::{SQRT_2, TAU};

use rand::{Rng, RngExt};

use super::sensors::Speed;

/// A sum of sines: amplitude, angular frequency \[rad/s\] and phase \[rad\] of each.
pub struct Multisine(pub Vec<[f64; 3]>);

/// Number of sines.
const TONES: u32 = 7;

impl Multisine {
    /// With root mean square `size`, between two frequencies \[Hz\], and random phases: the band is divided into slices of
    /// equal width on a logarithmic scale, with one frequency in each.
    pub fn draw(size: f64, [low, high]: [f64; 2], rng: &mut impl Rng) -> Self {
        let amplitude = size * (2.0 / f64::from(TONES)).sqrt();
        let tone = |k: u32| {
            let place = (f64::from(k) + rng.random::<f64>()) / f64::from(TONES);
            let frequency = low * (high / low).powf(place);
            [amplitude, TAU * frequency, TAU * rng.random::<f64>()]
        };
        Self((0..TONES).map(tone).collect())
    }

    /// The same motion in another size.
    pub fn times(&self, factor: f64) -> Self {
        let tones = self.0.iter();
        Self(tones.map(|[a, w, p]| [factor * a, *w, *p]).collect())
    }

    pub fn at(&self, time: f64) -> f64 {
        self.sum(|[a, w, p]| a * (w * time + p).sin())
    }

    /// Time derivative.
    pub fn rate(&self, time: f64) -> f64 {
        self.sum(|[a, w, p]| a * w * (w * time + p).cos())
    }

    /// Second time derivative.
    pub fn acceleration(&self, time: f64) -> f64 {
        self.sum(|[a, w, p]| -a * w * w * (w * time + p).sin())
    }

    fn sum(&self, tone: impl Fn([f64; 3]) -> f64) -> f64 {
        self.0.iter().copied().map(tone).sum()
    }
}

/// A torque over time.
pub type Signal = Box<dyn Fn(f64) -> f64>;

/// A sine of root mean square `size` whose frequency rises from one end of a band \[Hz\] to the other in `seconds`, by the
/// same factor in every second.
pub fn chirp(size: f64, [low, high]: [f64; 2], seconds: f64, rng: &mut impl Rng) -> Signal {
    let (start, growth) = (TAU * low, (high / low).ln() / seconds);
    let phase = TAU * rng.random::<f64>();
    Box::new(move |time| {
        let turned = start / growth * (growth * time).exp_m1();
        size * SQRT_2 * (turned + phase).sin()
    })
}

/// A value of root mean square `size` that jumps and stays, each time for half a period of a frequency in the band \[Hz\].
pub fn steps(size: f64, [low, high]: [f64; 2], seconds: f64, rng: &mut impl Rng) -> Signal {
    // Each value and the time until which it holds.
    let (mut until, mut values) = (0.0, Vec::new());
    while until <= seconds {
        until += 0.5 / (low * (high / low).powf(rng.random::<f64>()));
        // The root mean square of a uniform distribution is its half-width divided by the root of 3.
        values.push((until, 3.0_f64.sqrt() * size * rng.random_range(-1.0..=1.0)));
    }
    Box::new(move |time| {
        let k = values.partition_point(|(until, _)| *until <= time);
        values[k.min(values.len() - 1)].1
    })
}

/// The position controller of a simple rig: a PD controller that sees only the measured angle.
pub struct Controller {
    /// \[N m/rad\]
    pub stiffness: f64,
    /// \[N m s/rad\]
    pub damping: f64,
    /// Largest torque that it commands \[N m\].
    pub limit: f64,
    pub speed: Speed,
}

/// Time constant of the filter after the difference quotient \[s\].
const FILTER_S: f64 = 0.01;

impl Controller {
    /// The command \[N m\] for an angle measured `dt` s after the previous one, given the reference angle and speed.
    pub fn command(&mut self, measured: f64, [angle, speed]: [f64; 2], dt: f64) -> f64 {
        let moves = self.speed.at(measured, dt, FILTER_S);
        let torque = self.stiffness * (angle - measured) + self.damping * (speed - moves);
        torque.clamp(-self.limit, self.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::{Controller, Multisine, chirp, steps};
    use crate::sensors::Speed;
    use residyn_core::rng;

    #[test]
    fn a_multisine_has_the_size_and_the_slope_asked_for() {
        let sine = Multisine::draw(2.0, [0.5, 3.0], &mut rng(4));
        let samples = 200_000;
        let at = |k: i32| sine.at(0.001 * f64::from(k));
        let mean_square = (0..samples).map(|k| at(k).powi(2)).sum::<f64>() / f64::from(samples);
        assert!((mean_square.sqrt() - 2.0).abs() < 0.02, "{mean_square}");
        let slope = (sine.at(1.0 + 1e-6) - sine.at(1.0 - 1e-6)) / 2e-6;
        assert!((sine.rate(1.0) - slope).abs() < 1e-6);
    }

    #[test]
    fn a_chirp_and_steps_have_the_size_asked_for() {
        let rng = &mut rng(4);
        let (chirp, steps) = (
            chirp(2.0, [0.5, 5.0], 1000.0, rng),
            steps(2.0, [0.5, 5.0], 1000.0, rng),
        );
        let size = |at: &dyn Fn(f64) -> f64| {
            let squares = (0..100_000).map(|k| at(0.01 * f64::from(k)).powi(2));
            (squares.sum::<f64>() / 1e5).sqrt()
        };
        assert!((size(&chirp) - 2.0).abs() < 0.05);
        assert!((size(&steps) - 2.0).abs() < 0.15);
        // At the end of the band the sine crosses zero ten times a second.
        let signs: Vec<bool> = (0..10_000)
            .map(|k| chirp(999.0 + 1e-4 * f64::from(k)) > 0.0)
            .collect();
        let crossings = signs.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!((9..=11).contains(&crossings), "{crossings}");
    }

    #[test]
    fn a_controller_pushes_towards_the_reference_within_its_limit() {
        let mut controller = Controller {
            stiffness: 10.0,
            damping: 1.0,
            limit: 3.0,
            speed: Speed::default(),
        };
        assert_eq!(controller.command(0.0, [0.1, 0.0], 0.01), 1.0);
        // 0.2 rad on in 10 ms: half of 20 rad/s has passed the filter.
        let braking: f64 = 10.0 * (0.1 - 0.2) - 10.0;
        assert_eq!(controller.command(0.2, [0.1, 0.0], 0.01), braking.max(-3.0));
    }
}
