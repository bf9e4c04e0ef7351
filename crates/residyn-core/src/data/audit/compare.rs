//! How the channels of one joint agree: logged with derived velocity, acceleration with torque.

use std::ops::Range;

use serde::Serialize;

use super::channel::Channel;
use super::motion::Motion;
use super::regression::regressors;
use crate::data::Joint;
use crate::data::jumps::{JUMP_MADS, JUMP_RESOLUTION_STEPS, JUMP_SHARE_OF_RANGE};
use crate::data::lag::{Lag, lag};
use crate::data::projection::{dot, orthonormal, unexplained};
use crate::data::signal::interpolate;
use crate::data::statistics::{SIGMA_PER_MAD, mad, median_of};

/// The longest lag looked for \[s\]. Filters and buses of real rigs stay below 40 ms; a longer search
/// would find chance agreements.
pub const MAX_LAG_S: f64 = 0.05;

/// Two columns of one quantity correlate by more than this.
pub(super) const MIN_CORRELATION: f64 = 0.9;

/// Below this correlation of acceleration and torque, the lag between them means little: on measured
/// logs of one rig it scattered by several steps.
const MIN_TORQUE_CORRELATION: f64 = 0.5;

/// If gravity, friction and the other joints explain all but this share of an acceleration, the rest is the error of
/// that regression and shows spurious lags: a single sine is the usual case.
const MIN_UNEXPLAINED: f64 = 0.02;

/// How far the agreement is followed to where the acceleration precedes the torque, samples: a torque that is a mean
/// over the last period acted half a step before its row, and time stamps have errors.
const MAX_TORQUE_LEAD: isize = 2;

/// An acceleration cannot precede its torque by more than this many steps, a mean's half and the half that holding adds:
/// beyond, the torque follows the motion, of a controller or of a joint that sticks and slips, and there is no lag to
/// measure.
const MAX_LEAD_STEPS: f64 = 1.0;

/// The logged velocity against the derivative of the logged angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VelocityCheck {
    /// Correlation of the two at their best lag; low when they are not the same quantity.
    pub correlation: f64,
    /// By how much the logged velocity trails the derivative \[s\]; at most [`MAX_LAG_S`] is seen.
    pub lag_s: f64,
    /// Logged velocity over derivative, lag allowed for; 1 for a velocity in rad/s.
    pub scale: f64,
    /// Noise of the logged velocity \[rad/s\]: the median absolute difference of the two in motion as a
    /// standard deviation, lag and scale allowed for.
    pub noise_std_rad_s: f64,
    /// Largest difference \[rad/s\], lag and scale allowed for.
    pub worst_rad_s: f64,
}

/// The acceleration against the torque that drives it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TorqueLag {
    /// By how much the acceleration trails the torque \[s\], beyond the half step that holding a torque over each step
    /// adds by itself.
    pub lag_s: f64,
    /// Correlation of the two at that lag, after gravity, friction and the other joints' acceleration
    /// are taken out of both by linear regression.
    pub correlation: f64,
}

/// The speeds between which a joint moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Speeds {
    /// Slower than this, it cannot be distinguished from a joint at rest \[rad/s\].
    pub rest_rad_s: f64,
    /// 95 % of the rows are slower than this \[rad/s\].
    pub fast_rad_s: f64,
}

/// Compares logged and derived velocity, and finds the rows in which they disagree.
pub(super) fn velocity_check(
    motion: &Motion,
    qd: &Channel,
    speeds: Speeds,
    step_s: f64,
) -> (Option<VelocityCheck>, Vec<usize>) {
    let Speeds {
        rest_rad_s,
        fast_rad_s,
    } = speeds;
    let found = lag_of(motion, &motion.qd, step_s).filter(|_| fast_rad_s > 2.0 * rest_rad_s);
    let Some(found) = found else {
        return (None, Vec::new());
    };
    let lag_s = found.samples * lag_step_s(step_s);
    let (rows, pairs) = aligned_velocities(motion, lag_s);
    let scale = velocity_scale(&pairs, fast_rad_s);
    let off = |(logged, derived): &(f64, f64)| logged - scale * derived;
    // At rest both are zero and agree to the last digit, which says nothing about rows in motion.
    let moving = pairs.iter().filter(|pair| pair.1.abs() > rest_rad_s);
    let spread = mad(&moving.map(off).collect::<Vec<_>>());
    let floor = (JUMP_MADS * spread)
        .max(JUMP_SHARE_OF_RANGE * scale.abs() * fast_rad_s)
        .max(JUMP_RESOLUTION_STEPS * qd.resolution);
    let sizes = || pairs.iter().map(|pair| off(pair).abs());
    let disagreeing = rows.iter().zip(sizes()).filter(|(_, size)| *size > floor);
    let check = VelocityCheck {
        correlation: found.correlation,
        lag_s,
        scale,
        noise_std_rad_s: SIGMA_PER_MAD * spread,
        worst_rad_s: sizes().fold(0.0, f64::max),
    };
    (Some(check), disagreeing.map(|(row, _)| *row).collect())
}

/// Correlation of the logged velocity with the negative derivative, if it is higher than the one with the derivative.
pub(super) fn opposed_velocity(
    motion: &Motion,
    check: Option<VelocityCheck>,
    step_s: f64,
) -> Option<f64> {
    let direct = check?.correlation;
    let negated = |values: &[f64]| values.iter().map(|value| -value).collect::<Vec<f64>>();
    let found = lag_of(motion, &negated(&motion.qd), step_s)?;
    (found.correlation > direct && !found.at_edge).then_some(found.correlation)
}

/// Rows, and the logged velocity of each with the derivative of the angle `lag_s` earlier.
fn aligned_velocities(motion: &Motion, lag_s: f64) -> (Vec<usize>, Vec<(f64, f64)>) {
    let of_interval = |rows: Range<usize>| {
        let (time, velocity) = (&motion.time[rows.clone()], &motion.velocity[rows.clone()]);
        let derived = move |k: usize| interpolate(time, velocity, motion.time[k] - lag_s);
        rows.filter_map(move |k| Some((motion.rows[k], (motion.qd[k], derived(k)?))))
    };
    let intervals = motion.intervals.iter().cloned();
    intervals.flat_map(of_interval).unzip()
}

/// Ratio of logged to derived velocity: the median over the rows faster than a third of the fast
/// speed, which spikes cannot move and slow rows cannot blur.
fn velocity_scale(pairs: &[(f64, f64)], fast_rad_s: f64) -> f64 {
    let fast = pairs.iter().filter(|pair| pair.1.abs() > fast_rad_s / 3.0);
    median_of(fast.map(|(logged, derived)| logged / derived).collect())
}

/// The step of the uniform series that lags are sought on \[s\]: the log's own, but not below 1 ms, as
/// the parabola refines the lag far below the step and the derivatives hold nothing faster.
fn lag_step_s(step_s: f64) -> f64 {
    step_s.max(0.001)
}

/// The longest lag to look at, in samples.
fn reach(step_s: f64) -> isize {
    (MAX_LAG_S / lag_step_s(step_s)).ceil().max(2.0) as isize
}

/// The lag of a velocity behind the derivative of the angle.
fn lag_of(motion: &Motion, velocity: &[f64], step_s: f64) -> Option<Lag> {
    let uniform = |values: &[f64]| motion.resampled(values, lag_step_s(step_s));
    let (derived, logged) = (uniform(&motion.velocity), uniform(velocity));
    let ones = vec![1.0; derived.len()];
    let reach = reach(step_s);
    lag(&derived, &logged, &[ones], -reach..=reach)
}

/// Finds how the acceleration of a joint trails its torque.
///
/// By itself the acceleration of a swinging joint follows gravity more than torque, and under feedback the torque
/// follows the motion. So the part that is linear in the sine and cosine of the angles, in the velocities and their
/// signs, and in the other joints' accelerations, is removed from both first.
///
/// `fast_rad_s` holds the fast speed of every joint.
pub(super) fn torque_lag(
    motions: &[Motion],
    fast_rad_s: &[f64],
    joint: Joint,
    step_s: f64,
) -> Option<TorqueLag> {
    let uniform = |values: &[f64]| motions[joint].resampled(values, lag_step_s(step_s));
    let columns = regressors(motions, fast_rad_s, joint);
    let basis: Vec<Vec<f64>> = columns.iter().map(|column| uniform(column)).collect();
    let motion = &motions[joint];
    let (tau, acceleration) = (uniform(&motion.tau), uniform(&motion.acceleration));
    if unexplained_share(&basis, &acceleration) < MIN_UNEXPLAINED {
        return None;
    }
    let lags = -MAX_TORQUE_LEAD..=reach(step_s);
    let found = lag(&tau, &acceleration, &basis, lags)?;
    let clear = found.correlation >= MIN_TORQUE_CORRELATION && !found.at_edge;
    let lag_s = found.samples * lag_step_s(step_s) - 0.5 * step_s;
    let is_cause = lag_s >= -MAX_LEAD_STEPS * step_s;
    (clear && is_cause).then_some(TorqueLag {
        lag_s,
        correlation: found.correlation,
    })
}

/// Share of a series' variance that the columns do not explain; the first of them is a constant.
fn unexplained_share(columns: &[Vec<f64>], series: &[f64]) -> f64 {
    let basis = orthonormal(columns.iter().cloned());
    let left = |basis: &[Vec<f64>]| {
        let rest = unexplained(basis, series);
        dot(&rest, &rest)
    };
    let constant = basis.get(..1).unwrap_or_default();
    left(&basis) / left(constant).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::super::joint::{JointAudit, audit_joints};
    use super::super::tests::{each, edited, one_joint, swing, uniform};
    use crate::data::Columns;
    use crate::data::log::Log;

    fn joint(log: &Log) -> JointAudit {
        audit_joints(log, &Columns::default()).0.remove(0)
    }

    #[test]
    fn a_consistent_velocity_has_scale_one_and_no_lag() {
        let joint = joint(&swing());
        let check = joint.velocity.unwrap();
        assert!((check.scale - 1.0).abs() < 1e-3, "{check:?}");
        let is_exact = check.lag_s.abs() < 1e-4 && check.correlation > 0.999;
        assert!(is_exact, "{check:?}");
        assert_eq!(joint.qd.spikes, 0);
    }

    #[test]
    fn scale_lag_and_spikes_of_a_velocity_are_found_together() {
        let mut log = swing();
        // Degrees, three rows late.
        log.qd[0].rotate_right(3);
        each(&mut log.qd[0][3..], |_, v| v.to_degrees());
        (0..20).for_each(|i| log.qd[0][400 + 200 * i] += 300.0);
        let joint = joint(&log);
        let check = joint.velocity.unwrap();
        assert!((check.scale / 57.2958 - 1.0).abs() < 0.01, "{check:?}");
        assert!((check.lag_s - 0.006).abs() < 2e-4, "{check:?}");
        assert_eq!(joint.qd.spikes, 20);
        assert!((check.worst_rad_s - 300.0).abs() < 10.0);
    }

    #[test]
    fn a_backward_difference_lags_half_a_step() {
        let mut log = swing();
        let q = &log.q[0];
        each(&mut log.qd[0][1..], |row, _| (q[row + 1] - q[row]) / 0.002);
        let lag = joint(&log).velocity.unwrap().lag_s;
        assert!((lag - 0.001).abs() < 1e-4, "{lag}");
    }

    /// A joint with damping and gravity, driven by noise that is held over each step and acts `delay`
    /// steps late.
    fn driven(delay: usize) -> Log {
        let (rows, step) = (6000, 0.002);
        let mut torque = vec![0.0; rows];
        let mut state = 1_u32;
        for row in (0..rows - 10).step_by(10) {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            torque[row..row + 10].fill(f64::from(state) / 2.0_f64.powi(31) - 1.0);
        }
        let (mut q, mut v) = (0.0_f64, 0.0);
        let (mut qs, mut vs) = (vec![], vec![]);
        for row in 0..rows {
            qs.push(q);
            vs.push(v);
            let held = row.checked_sub(delay).map_or(0.0, |row| torque[row]);
            for _ in 0..20 {
                v += step / 20.0 * (-15.0 * q.sin() - 0.5 * v + 20.0 * held);
                q += step / 20.0 * v;
            }
        }
        one_joint(uniform(rows, step), qs, vs, torque)
    }

    #[test]
    fn the_torque_lag_is_the_delay_alone() {
        for delay in [0, 4] {
            let found = joint(&driven(delay)).torque_lag.unwrap();
            let off_s = found.lag_s - 0.002 * delay as f64;
            assert!(off_s.abs() < 5e-4, "{delay}: {found:?}");
        }
    }

    #[test]
    fn a_torque_that_follows_the_motion_has_no_lag() {
        let mut log = driven(0);
        log.tau[0].rotate_right(2);
        assert_eq!(joint(&log).torque_lag, None);
    }

    #[test]
    fn a_motion_that_gravity_explains_shows_no_torque_lag() {
        // A small swing alone: its acceleration is that of a spring, whatever the torque does.
        let log = edited(|log| {
            let over = |f: fn(f64) -> f64| log.time.iter().map(|t| f(*t)).collect();
            log.q[0] = over(|t| 0.1 * (5.0 * t).sin());
            log.qd[0] = over(|t| 0.5 * (5.0 * t).cos());
            log.tau[0] = over(|t| (5.0 * t - 0.1).cos() + 0.1 * (15.0 * t - 0.3).cos());
        });
        assert_eq!(joint(&log).torque_lag, None);
    }

    #[test]
    fn a_passive_joint_has_no_torque_lag() {
        let log = edited(|log| log.tau[0].fill(0.0));
        assert_eq!(joint(&log).torque_lag, None);
    }
}
