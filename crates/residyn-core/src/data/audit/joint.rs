//! One joint: whether its channels agree with each other, and what its motion can show.

use std::borrow::Cow;

use serde::Serialize;

use super::channel::Channel;
use super::compare::{
    Speeds, TorqueLag, VelocityCheck, opposed_velocity, torque_lag, velocity_check,
};
use super::demand::{TorqueDemand, torque_demand};
use super::motion::Motion;
use super::regression::Regression;
use super::response::{Response, response};
use crate::data::Joint;
use crate::data::column::Quantity;
use crate::data::columns::Columns;
use crate::data::jumps::rows_that_jump;
use crate::data::local_cubic::{LocalCubic, half_width_s};
use crate::data::log::{Interval, Log};
use crate::data::statistics::quantile;

/// Slower than this share of the fast speed counts as rest.
const REST_SHARE_OF_FAST: f64 = 0.01;

/// A motion of fewer quantisation steps (or noise deviations) than this says little: at rest an
/// encoder flickers over two or three steps, and a creeping joint over five or six.
pub(super) const VISIBLE_STEPS: f64 = 10.0;

/// Torque and acceleration are compared after smoothing over this on either side \[s\]: over less, accelerations from
/// an encoder of a few mrad are mostly noise.
const SLOW_S: f64 = 0.05;

/// One joint of a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointAudit {
    pub joint: Joint,
    /// The angle \[rad\], or the length of a joint that slides \[m\]; its other numbers are in m, m/s and N as well.
    pub q: Channel,
    /// The velocity as logged \[rad/s\].
    pub qd: Channel,
    /// The torque \[N m\], or the command of the drive.
    pub tau: Channel,
    /// How the logged velocity compares with the derivative of the angle; `None` if one of them stands still, the joint
    /// is too slow to be distinguished from one at rest, or the log is too short.
    pub velocity: Option<VelocityCheck>,
    /// Correlation of the logged velocity with the negative derivative of the angle, if it does not follow the
    /// derivative itself.
    pub opposed: Option<f64>,
    /// How the acceleration responds to torque and motion; `None` if there is no acceleration, or the log is too short.
    pub response: Option<Response>,
    /// How the acceleration trails the torque; `None` if the torque is constant, or too little of the acceleration
    /// follows it.
    pub torque_lag: Option<TorqueLag>,
    /// How the torque compares with what the motion needs; `None` if it is constant or the log is too short.
    pub torque_demand: Option<TorqueDemand>,
    /// How often the motion changes direction in the examined rows, jitter about rest not counted.
    pub reversals: usize,
    /// Share of the rows at rest: slower than 1 % of the fast speed, or than three standard deviations of the velocity
    /// noise that noise on the angle causes.
    pub share_at_rest: f64,
    /// Speed that 95 % of the rows stay below \[rad/s\], from the angles.
    pub fast_rad_s: f64,
    /// Whether the angle covers a full turn.
    pub covers_full_turn: bool,
    /// Share of the rows in motion that repeat the angle of the row before although it should have
    /// moved by two steps of its resolution: a logger that is faster than its source.
    pub repeated_fraction: f64,
    /// Rows in which the angle jumps.
    #[serde(skip)]
    pub(super) jumping: Vec<usize>,
    /// Where the torque jumps.
    #[serde(skip)]
    pub(super) spiky: Vec<Interval>,
    /// Where the logged velocity disagrees with the derivative of the angle.
    #[serde(skip)]
    pub(super) disagreeing: Vec<Interval>,
    /// Where the joint is at rest.
    #[serde(skip)]
    pub(super) at_rest: Vec<Interval>,
    /// Where its angle repeats that of the row before.
    #[serde(skip)]
    pub(super) repeated: Vec<Interval>,
}

/// Audits every joint of a log, and follows the motions in which accelerations are compared with torques.
///
/// Angles that jump for a single row are counted, and then masked.
pub(super) fn audit_joints(log: &Log, columns: &Columns) -> (Vec<JointAudit>, Vec<Motion>) {
    let jumps: Vec<Vec<usize>> = log.q.iter().map(|q| rows_that_jump(q)).collect();
    let log = &*log.without(&jumps);
    let step_s = log.median_step();
    let smoothed = |half_width_s: f64| -> Vec<Motion> {
        let all = Joint::all(log.joints());
        all.map(|joint| Motion::of(log, joint, half_width_s))
            .collect()
    };
    let mut joints: Vec<JointAudit> = Joint::all(log.joints())
        .zip(&smoothed(half_width_s(step_s)))
        .zip(jumps)
        .map(|((joint, motion), jumps)| JointAudit::of(log, columns, joint, motion, jumps))
        .collect();
    let slow_s = half_width_s(step_s).max(SLOW_S);
    let slow = smoothed(slow_s);
    let fast: Vec<f64> = joints.iter().map(|joint| joint.fast_rad_s).collect();
    for audit in &mut joints {
        let regression = Regression::of(&slow, &fast, audit.joint);
        audit.response = regression.as_ref().and_then(response);
        if log.driven_by == Quantity::Torque {
            audit.torque_demand = regression.and_then(|of| torque_demand(&of, slow_s));
            audit.torque_lag = torque_lag(&slow, &fast, audit.joint, step_s);
        } else if let Some(response) = &mut audit.response {
            // The torque that a drive makes of its command depends on the motion.
            response.to_torque = None;
        }
    }
    (joints, slow)
}

impl JointAudit {
    /// Whether it slides rather than turns.
    pub(super) fn slides(&self) -> bool {
        self.q.unit == "m"
    }

    /// Whether the joint moves visibly in this log.
    pub fn moves(&self) -> bool {
        let visible = VISIBLE_STEPS * self.q.resolution.max(self.q.noise_std);
        !self.q.constant && self.q.range() >= visible
    }

    /// Everything except what needs the other joints as well, or the log as it is.
    fn of(
        log: &Log,
        columns: &Columns,
        joint: Joint,
        motion: &Motion,
        jumping: Vec<usize>,
    ) -> Self {
        let step_s = log.median_step();
        let (q, qd, tau) = (&log.q[joint], &log.qd[joint], &log.tau[joint]);
        let channel = |of: Quantity, values, spikes| {
            Channel::of(
                joint.name(of.key()),
                columns.unit(of, joint),
                values,
                spikes,
            )
        };
        let q_channel = channel(Quantity::Angle, q, jumping.len());
        let qd_channel = channel(Quantity::Velocity, qd, 0);
        let spiky = rows_that_jump(tau);
        // A log too short for derivatives still has a speed: the logged one.
        let (rows, velocity) = match motion.rows() {
            0 => (Cow::from_iter(0..log.rows()), qd),
            _ => (Cow::from(&motion.rows), &motion.velocity),
        };
        let speeds: Vec<f64> = velocity.iter().map(|v| v.abs()).collect();
        let fast_rad_s = quantile(&speeds, 0.95);
        let rest_rad_s = rest_speed(&q_channel, fast_rad_s, step_s);
        let speed = Speeds {
            rest_rad_s,
            fast_rad_s,
        };
        let (check, disagreeing) = velocity_check(motion, &qd_channel, speed, step_s);
        let resting: Vec<usize> = (rows.iter().zip(&speeds))
            .filter(|(_, speed)| **speed <= rest_rad_s)
            .map(|(row, _)| *row)
            .collect();
        let visible_rad_s = (2.0 * q_channel.resolution / step_s).max(rest_rad_s);
        let moving = (0..motion.rows()).filter(|&k| motion.velocity[k].abs() > visible_rad_s);
        let moving: Vec<usize> = moving.collect();
        let repeats = moving.iter().filter(|&&k| motion.moved[k] == 0.0);
        let repeats: Vec<usize> = repeats.map(|&k| motion.rows[k]).collect();
        Self {
            joint,
            opposed: opposed_velocity(motion, check, step_s),
            velocity: check,
            response: None,
            torque_lag: None,
            torque_demand: None,
            reversals: reversals(velocity, rest_rad_s),
            share_at_rest: resting.len() as f64 / speeds.len().max(1) as f64,
            fast_rad_s,
            covers_full_turn: q_channel.unit == "rad" && q_channel.range() >= std::f64::consts::TAU,
            repeated_fraction: repeats.len() as f64 / moving.len().max(1) as f64,
            disagreeing: log.intervals(disagreeing.iter().copied()),
            at_rest: log.intervals(resting),
            repeated: log.intervals(repeats),
            q: q_channel,
            qd: Channel {
                spikes: disagreeing.len(),
                ..qd_channel
            },
            tau: channel(log.driven_by, tau, spiky.len()),
            spiky: log.intervals(spiky),
            jumping,
        }
    }
}

/// The speed below which a joint cannot be distinguished from one at rest \[rad/s\].
fn rest_speed(q: &Channel, fast_rad_s: f64, step_s: f64) -> f64 {
    let half_width = half_width_s(step_s);
    let rows = 1.0 + 2.0 * half_width / step_s;
    // Rounding to a step is noise of 1/sqrt(12) steps.
    let noise = q.noise_std.max(q.resolution / 12.0_f64.sqrt());
    let of_noise = 3.0 * noise * LocalCubic::slope_noise_gain(half_width, rows);
    of_noise.max(REST_SHARE_OF_FAST * fast_rad_s)
}

/// Changes of direction with speeds above `rest` on both sides.
fn reversals(velocity: &[f64], rest: f64) -> usize {
    let moving = velocity.iter().copied().filter(|v| v.abs() > rest);
    let turns = |pair: &&[f64]| pair[0] * pair[1] < 0.0;
    moving.collect::<Vec<_>>().windows(2).filter(turns).count()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{each, one_joint, swing, uniform};
    use super::*;

    fn joint(log: &Log) -> JointAudit {
        audit_joints(log, &Columns::default()).0.remove(0)
    }

    #[test]
    fn reversals_turns_and_rest_are_counted() {
        let time = uniform(8000, 0.001);
        // Two swings over 8 rad, then rest with the jitter of one encoder step.
        let angle = |t: f64| {
            if t < 4.0 {
                4.0 * (t * std::f64::consts::PI).cos()
            } else {
                4.0
            }
        };
        let jitter = |i: usize| 0.001 * f64::from(u8::from(i.is_multiple_of(7)));
        let rounded = |(i, t): (usize, &f64)| ((angle(*t) + jitter(i)) / 0.001).round() * 0.001;
        let q = time.iter().enumerate().map(rounded).collect();
        let joint = joint(&one_joint(time, q, vec![0.0; 8000], vec![0.0; 8000]));
        assert_eq!((joint.reversals, joint.velocity), (3, None));
        assert!(joint.covers_full_turn);
        assert!(
            (joint.share_at_rest - 0.5).abs() < 0.05,
            "{}",
            joint.share_at_rest
        );
    }

    #[test]
    fn a_logger_that_repeats_its_source_is_seen() {
        let mut log = swing();
        assert!(joint(&log).repeated_fraction < 0.01);
        let exact = log.q[0].clone();
        each(&mut log.q[0], |row, _| exact[row - row % 2]);
        assert!((joint(&log).repeated_fraction - 0.5).abs() < 0.05);
    }
}
