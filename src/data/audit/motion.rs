//! The motion of one joint as its angles tell it.

use crate::data::Joint;
use crate::data::local_cubic::local_cubic;
use crate::data::log::Log;

/// One joint's channels at the rows where the motion around them is known.
///
/// These are the rows that a cubic can be fitted around: not the ends of the log, nor its gaps. They
/// depend on the times alone, so they are the same rows for all joints of a log.
pub(super) struct Motion {
    /// The rows.
    pub rows: Vec<usize>,
    /// Time of the rows \[s\].
    pub time: Vec<f64>,
    /// Smoothed angle \[rad\].
    pub q: Vec<f64>,
    /// Velocity from the angles \[rad/s\].
    pub velocity: Vec<f64>,
    /// Acceleration from the angles \[rad/s^2\].
    pub acceleration: Vec<f64>,
    /// Torque smoothed as the angles are \[N m\].
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
        let mut motion = Self {
            rows: vec![],
            time: vec![],
            q: vec![],
            velocity: vec![],
            acceleration: vec![],
            tau: vec![],
            tau_logged: vec![],
            qd: vec![],
            moved: vec![],
        };
        for row in 1..log.rows() {
            let fit = |values: &[f64]| local_cubic(&log.time, values, row, half_width_s);
            let (Some(q), Some(tau)) = (fit(&log.q[joint]), fit(&log.tau[joint])) else {
                continue;
            };
            motion.rows.push(row);
            motion.time.push(log.time[row]);
            motion.q.push(q.value);
            motion.velocity.push(q.slope);
            motion.acceleration.push(q.curvature);
            motion.tau.push(tau.value);
            motion.tau_logged.push(log.tau[joint][row]);
            motion.qd.push(log.qd[joint][row]);
            motion.moved.push(log.q[joint][row] - log.q[joint][row - 1]);
        }
        motion
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }
}
