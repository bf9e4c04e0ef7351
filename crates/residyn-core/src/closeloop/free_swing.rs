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
