//! The motion of one joint, derived from its angles.

use std::ops::Range;

use crate::data::Joint;
use crate::data::examined::examined;
use crate::data::local_cubic::local_cubic;
use crate::data::log::Log;
use crate::data::signal::resample;

/// One joint's channels at the rows where the motion around them is known.
///
/// These are the examined rows around which a cubic can be fitted: neither the ends of the log nor its gaps. They
/// depend on the times alone, so they are the same rows for all joints of a log.
#[derive(Clone, Default)]
pub(super) struct Motion {
    /// The rows.
    pub rows: Vec<usize>,
    /// Which of them belong to each examined interval of the log.
    pub intervals: Vec<Range<usize>>,
    /// Time of the rows \[s\].
    pub time: Vec<f64>,
    /// Smoothed angle \[rad\].
    pub q: Vec<f64>,
    /// Velocity from the angles \[rad/s\].
    pub velocity: Vec<f64>,
    /// Acceleration from the angles \[rad/s^2\].
    pub acceleration: Vec<f64>,
    /// Torque, smoothed like the angles \[N m\].
    pub tau: Vec<f64>,
    /// Torque as logged \[N m\], not smoothed.
    pub tau_logged: Vec<f64>,
    /// Velocity as logged \[rad/s\], not smoothed.
    pub qd: Vec<f64>,
    /// Change of the logged angle since the row before \[rad\].
    pub moved: Vec<f64>,
}

impl Motion {
    /// Follows a joint through the log, smoothed over `half_width_s` on either side.
    pub fn of(log: &Log, joint: Joint, half_width_s: f64) -> Self {
        let mut motion = Self::default();
        for interval in examined(log.rows()) {
            let first = motion.rows();
            motion.follow(log, joint, half_width_s, interval);
            motion.intervals.push(first..motion.rows());
        }
        motion
    }

    /// Adds an interval of the log.
    fn follow(&mut self, log: &Log, joint: Joint, half_width_s: f64, interval: Range<usize>) {
        for row in interval.filter(|row| *row > 0) {
            let fit = |values: &[f64]| local_cubic(&log.time, values, row, half_width_s);
            let (Some(q), Some(tau)) = (fit(&log.q[joint]), fit(&log.tau[joint])) else {
                continue;
            };
            self.rows.push(row);
            self.time.push(log.time[row]);
            self.q.push(q.value);
            self.velocity.push(q.slope);
            self.acceleration.push(q.curvature);
            self.tau.push(tau.value);
            self.tau_logged.push(log.tau[joint][row]);
            self.qd.push(log.qd[joint][row]);
            self.moved.push(log.q[joint][row] - log.q[joint][row - 1]);
        }
    }

    /// The motion with the angle and all its derivatives scaled by this factor.
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        let of_angle = [
            &mut scaled.q,
            &mut scaled.velocity,
            &mut scaled.acceleration,
            &mut scaled.qd,
            &mut scaled.moved,
        ];
        let values = of_angle.into_iter().flatten();
        values.for_each(|value| *value *= factor);
        scaled
    }

    /// One of its columns at a uniform step \[s\], interval after interval.
    pub fn resampled(&self, values: &[f64], step_s: f64) -> Vec<f64> {
        let intervals = self.intervals.iter().cloned();
        let of_interval =
            |rows: Range<usize>| resample(&self.time[rows.clone()], &values[rows], step_s);
        intervals.flat_map(of_interval).collect()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }
}
