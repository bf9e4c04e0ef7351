//! What is logged of a rig: encoders, torque sensor, clock, and lost rows.

use std::f64::consts::FRAC_1_SQRT_2;

use rand::{Rng, RngExt};
use rand_distr::{Distribution, Normal};
use serde::{Deserialize, Serialize};

use residyn_core::data::Log;

/// Flaws of a logger; all zero for a good one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Flaws {
    /// Standard deviation of the time between two rows, as a share of that time.
    pub jitter: f64,
    /// Standard deviation of the reported times from those of the readings \[s\].
    pub stamps_s: f64,
    /// Share of the rows that are lost.
    pub dropped: f64,
    /// Share of the rows that repeat all readings of the row before.
    pub repeated: f64,
    /// Largest number of rows lost or repeated at once.
    pub burst: usize,
    /// Standard deviation of the logged torque, and the step in which it is logged (zero for a fine one), as shares of
    /// the joint's largest torque.
    pub torque_noise: f64,
    pub torque_quantum: f64,
    /// Time constant of the filter after the difference quotient of the positions \[s\].
    pub filter_s: f64,
}

impl Flaws {
    /// Whether a logger can have these flaws.
    ///
    /// # Errors
    /// Why not.
    pub(crate) fn check(&self) -> Result<(), String> {
        let sizes = [
            self.jitter,
            self.stamps_s,
            self.torque_noise,
            self.torque_quantum,
            self.filter_s,
        ];
        let sound = sizes.iter().all(|size| *size >= 0.0)
            && [self.dropped, self.repeated]
                .iter()
                .all(|share| (0.0..0.5).contains(share) && (*share == 0.0 || self.burst > 0));
        let needs = "`flaws` needs numbers that are not negative, `dropped` and `repeated` below a half, and `burst` with them";
        if sound { Ok(()) } else { Err(needs.to_owned()) }
    }

    /// The logged value of a command to a joint whose largest torque is `limit` \[N m\].
    pub fn torque(&self, command: f64, limit: f64, rng: &mut impl Rng) -> f64 {
        match (self.torque_noise, self.torque_quantum) {
            (0.0, 0.0) => command,
            (noise, quantum) => sensed(command, limit * noise, limit * quantum, rng),
        }
    }
}

/// The steps of a clock: its ticks deviate from their nominal times, but the reported times are right.
pub struct Clock<'c> {
    step_s: f64,
    flaws: &'c Flaws,
    ticks: u32,
}

/// A tick is off by at most this share of a step, so that time always increases.
const FARTHEST: f64 = 0.45;

impl<'c> Clock<'c> {
    pub fn new(rate_hz: f64, flaws: &'c Flaws) -> Self {
        Self {
            step_s: 1.0 / rate_hz,
            flaws,
            ticks: 0,
        }
    }

    /// Time of the next tick \[s\].
    pub fn next(&mut self, rng: &mut impl Rng) -> f64 {
        self.ticks += 1;
        let off = match self.flaws.jitter {
            // A step ends at two ticks, both of them off.
            jitter if jitter > 0.0 => normal(FRAC_1_SQRT_2 * jitter, rng),
            _ => 0.0,
        };
        (f64::from(self.ticks) + off.clamp(-FARTHEST, FARTHEST)) * self.step_s
    }

    /// The time that is reported for a reading at `time` \[s\].
    pub fn stamp(&self, time: f64, rng: &mut impl Rng) -> f64 {
        match self.flaws.stamps_s {
            deviation if deviation > 0.0 => {
                let farthest = FARTHEST * self.step_s;
                time + normal(deviation, rng).clamp(-farthest, farthest)
            }
            _ => time,
        }
    }
}

/// Which rows are lost, or repeated.
pub struct Losses {
    share: f64,
    /// Largest number at once.
    burst: usize,
    /// Number of rows still to be lost in the current loss.
    left: usize,
}

impl Losses {
    pub fn new(share: f64, burst: usize) -> Self {
        Self {
            share,
            burst,
            left: 0,
        }
    }

    /// Whether the next row is lost.
    pub fn next(&mut self, rng: &mut impl Rng) -> bool {
        if self.left > 0 {
            self.left -= 1;
            return true;
        }
        if self.share == 0.0 {
            return false;
        }
        #[allow(clippy::cast_precision_loss)] // a few rows
        let mean = 0.5 * (1 + self.burst) as f64;
        // Losses of `mean` rows begin in this share of the rows between them.
        let begins = self.share / (mean * (1.0 - self.share));
        let lost = rng.random::<f64>() < begins;
        if lost {
            self.left = rng.random_range(0..self.burst);
        }
        lost
    }
}

/// Rows of `log` that repeat all readings of the row before, at their own times.
pub fn repeat(log: &mut Log, flaws: &Flaws, rng: &mut impl Rng) {
    let mut repeats = Losses::new(flaws.repeated, flaws.burst);
    for row in 1..log.rows() {
        if repeats.next(rng) {
            let channels = [&mut log.q, &mut log.qd, &mut log.tau];
            let all = channels.into_iter().flatten();
            all.for_each(|channel| channel[row] = channel[row - 1]);
        }
    }
}

/// A value with white noise of this standard deviation, in whole steps of `quantum` unless that is zero.
pub fn sensed(value: f64, noise: f64, quantum: f64, rng: &mut impl Rng) -> f64 {
    let value = value + normal(noise, rng);
    match quantum {
        quantum if quantum > 0.0 => (value / quantum).round() * quantum,
        _ => value,
    }
}

fn normal(deviation: f64, rng: &mut impl Rng) -> f64 {
    let normal = Normal::new(0.0, deviation).expect("the grid was checked");
    normal.sample(rng)
}

/// The speed of a joint as a rig's controller derives it from the angles: a filtered difference quotient.
#[derive(Clone, Default)]
pub struct Speed {
    previous: Option<f64>,
    value: f64,
}

impl Speed {
    /// The speed \[rad/s\] at an angle measured `dt` s after the previous one, through a first-order filter with time
    /// constant `filter_s`; zero at the first angle.
    pub fn at(&mut self, angle: f64, dt: f64, filter_s: f64) -> f64 {
        let raw = (angle - self.previous.unwrap_or(angle)) / dt;
        self.previous = Some(angle);
        self.value += (raw - self.value) * dt / (filter_s + dt);
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::{Clock, Flaws, Losses};
    use residyn_core::rng;

    const MESSY: Flaws = Flaws {
        jitter: 0.2,
        stamps_s: 3e-4,
        dropped: 0.03,
        repeated: 0.0,
        burst: 4,
        torque_noise: 0.0,
        torque_quantum: 0.0,
        filter_s: 0.0,
    };

    #[test]
    fn steps_of_a_clock_vary_as_much_as_asked_for_and_time_rises() {
        let rng = &mut rng(3);
        let mut clock = Clock::new(100.0, &MESSY);
        let times: Vec<f64> = (0..20_000).map(|_| clock.next(rng)).collect();
        let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.iter().all(|step| *step > 0.0));
        let square = steps.iter().map(|step| (step - 0.01).powi(2)).sum::<f64>();
        let deviation = (square / steps.len() as f64).sqrt() / 0.01;
        assert!((deviation - 0.2).abs() < 0.01, "{deviation}");
        assert!((times[19_999] - 200.0).abs() < 0.01);
        let off = |time: &f64| (clock.stamp(*time, rng) - time).powi(2);
        let deviation = (times.iter().map(off).sum::<f64>() / times.len() as f64).sqrt();
        assert!((deviation - 3e-4).abs() < 1e-5, "{deviation}");
    }

    #[test]
    fn rows_are_lost_in_the_share_asked_for_and_several_at_once() {
        let rng = &mut rng(3);
        let mut losses = Losses::new(MESSY.dropped, MESSY.burst);
        let lost: Vec<bool> = (0..100_000).map(|_| losses.next(rng)).collect();
        let count = lost.iter().filter(|lost| **lost).count();
        assert!((2700..3300).contains(&count), "{count}");
        let longest = lost.split(|lost| !lost).map(<[bool]>::len).max();
        assert!((2..=8).contains(&longest.unwrap()), "{longest:?}");
    }
}
