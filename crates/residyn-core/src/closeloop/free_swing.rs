//! Horizons for the free motion of a rig without a drive. Its damping may take a minute to show: over half a second it
//! is less than the noise.

use super::settings::Settings;
use crate::data::statistics::{mean, sample_deviation};
use crate::data::{Log, Quantity};
use crate::model::Model;

impl Settings {
    /// The same settings with errors over several swings, if nothing drives the joint of the logs. Never for several
    /// joints: their free motion may be chaotic, and then long windows compare nothing but start states.
    pub(super) fn over_swings(self, model: &Model, logs: &[Log]) -> Self {
        let is_driven = logs
            .iter()
            .flat_map(|log| log.tau.iter().flatten())
            .any(|tau| *tau != 0.0);
        if is_driven || model.joints > 1 || model.driven_by() == Quantity::Command {
            return self;
        }
        let swing_s = logs.iter().filter_map(swing_s).fold(0.0, f64::max);
        let all_s: f64 = logs.iter().map(Log::duration).sum();
        let most_s = all_s / (2 * self.verdict.fewest_windows) as f64;
        // Tenths of a second are as good as any other length, and are read more easily.
        let window_s = (10.0 * (self.fit.swings * swing_s).min(most_s)).floor() / 10.0;
        let mut horizons_s = self.score.horizons_s.clone();
        horizons_s.retain(|horizon_s| *horizon_s <= self.fit.window_s);
        // As many shorter ones as longer ones: models are compared at the middle one.
        let longer = (1..=horizons_s.len() as i32).map(|k| window_s * 2.0_f64.powi(k));
        match window_s > self.fit.window_s {
            true => {
                let longer: Vec<f64> = longer.collect();
                self.with_horizons([horizons_s, vec![window_s], longer].concat())
            }
            false => self,
        }
    }
}

/// The mean length of a swing in s; `None` if the joint does not swing to and fro. A swing passes half a standard
/// deviation on both sides of the mean: noise at rest does not.
fn swing_s(log: &Log) -> Option<f64> {
    let q = &log.q[0];
    let (centre, width) = (mean(q), 0.5 * sample_deviation(q));
    let far = q.iter().filter(|angle| (*angle - centre).abs() > width);
    let sides: Vec<bool> = far.map(|angle| *angle > centre).collect();
    let passes = sides.windows(2).filter(|pair| pair[0] != pair[1]).count();
    (passes > 1).then(|| 2.0 * log.duration() / passes as f64)
}

#[cfg(test)]
mod tests {
    use super::Settings;
    use crate::closeloop::tests::pendulum;
    use crate::data::Log;

    /// A minute at 50 Hz of a swing every 2 s, with this torque.
    fn swing(tau: f64) -> Log {
        let mut log = Log::empty(1);
        log.time = (0..3000).map(|row| 0.02 * f64::from(row)).collect();
        let angle = |t: &f64| 0.3 * (std::f64::consts::PI * t).cos();
        log.q = vec![log.time.iter().map(angle).collect()];
        log.qd = vec![vec![0.0; 3000]];
        log.tau = vec![vec![tau; 3000]];
        log
    }

    #[test]
    fn a_free_motion_is_compared_over_several_swings() {
        let of = |log: Log| Settings::default().over_swings(&pendulum(), &[log]);
        let free = of(swing(0.0));
        // Eight windows and as many for the test need shorter ones than three swings of 2 s.
        assert_eq!(free.score.horizons_s, [0.1, 0.5, 3.7, 7.4, 14.8]);
        assert_eq!((free.fit.window_s, free.score.middle_s()), (3.7, 3.7));
        assert_eq!(of(swing(0.1)), Settings::default());
    }

    #[test]
    fn horizons_that_are_given_set_the_windows() {
        let given = Settings::default().with_horizons(vec![2.0, 0.1, 1.0]);
        assert_eq!(given.score.horizons_s, [0.1, 1.0, 2.0]);
        assert_eq!(given.fit.window_s, 1.0);
    }
}
