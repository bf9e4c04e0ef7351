//! How the logged torque compares with what the motion needs.

use serde::Serialize;

use super::motion::Motion;
use super::regressors::regressors;
use crate::data::Joint;
use crate::data::local_cubic::LocalCubic;
use crate::data::projection::{explained_by, orthonormal};
use crate::data::statistics::{deviation, rms};

/// Rows beyond this many times the largest torque that the motion needs count as far off.
const FAR_OFF: f64 = 2.0;

/// A regression with fewer rows than this per column says nothing.
const ROWS_A_COLUMN: usize = 10;

/// The torque of a joint against a linear regression of it on the joint's motion: gravity, friction, the
/// accelerations of all joints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TorqueDemand {
    /// Content slower than this counts as slow \[Hz\].
    pub slow_hz: f64,
    /// Root mean square of the slow torque about its mean \[N m\].
    pub slow_nm: f64,
    /// Root mean square of the rest, which is faster than the motion \[N m\].
    pub fast_nm: f64,
    /// The largest torque that the motion needs, by the regression of the slow torque \[N m\].
    pub needed_nm: f64,
    /// Share of the rows beyond twice that.
    pub far_off: f64,
    /// Share of the variance of the slow torque that the regression explains.
    pub explained_slow: f64,
    /// Share of the variance of the torque as logged that a regression explains.
    pub explained: f64,
}

/// Compares one joint's torque with its motion; `None` if the torque is constant or the log too short.
///
/// `fast_rad_s` holds the fast speed of every joint; the motions are smoothed over `half_width_s` on either side.
pub(super) fn torque_demand(
    motions: &[Motion],
    fast_rad_s: &[f64],
    joint: Joint,
    half_width_s: f64,
) -> Option<TorqueDemand> {
    let motion = &motions[joint];
    let mut columns = regressors(motions, fast_rad_s, joint);
    columns.push(motion.acceleration.clone());
    if motion.rows() < ROWS_A_COLUMN * columns.len() {
        return None;
    }
    let basis = orthonormal(columns.into_iter());
    let (slow, logged) = (&motion.tau, &motion.tau_logged);
    let (about_mean, of_logged) = (deviation(slow), deviation(logged));
    let is_constant = logged.windows(2).all(|pair| pair[0] == pair[1]);
    // The squares of very small torques are zero as well.
    if is_constant || about_mean == 0.0 || of_logged == 0.0 {
        return None;
    }
    let needed = explained_by(&basis, slow);
    let needed_nm = needed.iter().fold(0.0_f64, |top, tau| top.max(tau.abs()));
    let far = |tau: &&f64| tau.abs() > FAR_OFF * needed_nm;
    let left = |series: &[f64]| rms(&difference(series, &explained_by(&basis, series)));
    Some(TorqueDemand {
        slow_hz: LocalCubic::cutoff_hz(half_width_s),
        slow_nm: about_mean,
        fast_nm: rms(&difference(logged, slow)),
        needed_nm,
        far_off: logged.iter().filter(far).count() as f64 / logged.len() as f64,
        explained_slow: 1.0 - (left(slow) / about_mean).powi(2),
        explained: 1.0 - (left(logged) / of_logged).powi(2),
    })
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

#[cfg(test)]
mod tests {
    use super::super::joint::audit_joints;
    use super::super::tests::swing;
    use super::TorqueDemand;
    use crate::data::log::Log;

    fn demand(log: &Log) -> Option<TorqueDemand> {
        audit_joints(log).remove(0).torque_demand
    }

    #[test]
    fn a_torque_that_moves_the_joint_is_explained_by_the_motion() {
        let found = demand(&swing()).unwrap();
        assert!(found.explained > 0.999, "{found:?}");
        assert!(found.fast_nm < 0.02 * found.slow_nm && found.far_off == 0.0);
        // 9 sin + 21.3 sin: at most 30.3, and about that at some time.
        assert!((27.0..30.5).contains(&found.needed_nm), "{found:?}");
    }

    #[test]
    fn chatter_stays_apart_from_the_motion() {
        let mut log = swing();
        // +-30 N m from row to row: 250 Hz.
        let signs = [30.0, -30.0].into_iter().cycle();
        log.tau[0]
            .iter_mut()
            .zip(signs)
            .for_each(|(tau, c)| *tau += c);
        let found = demand(&log).unwrap();
        assert!((found.fast_nm - 30.0).abs() < 1.5, "{found:?}");
        assert!(found.explained_slow > 0.99, "{found:?}");
        // Two sines of power 9^2 / 2 + 21.3^2 / 2 = 268 against the chatter's 900.
        assert!((found.explained - 0.23).abs() < 0.02, "{found:?}");
        log.tau[0]
            .iter_mut()
            .step_by(50)
            .for_each(|tau| *tau += 100.0);
        let far_off = demand(&log).unwrap().far_off;
        assert!((far_off - 0.02).abs() < 0.002, "{far_off}");
    }

    #[test]
    fn constant_torques_and_short_logs_have_no_demand() {
        let mut log = swing();
        log.tau[0].fill(0.7);
        assert_eq!(demand(&log), None);
        let mut log = swing();
        for column in [
            &mut log.time,
            &mut log.q[0],
            &mut log.qd[0],
            &mut log.tau[0],
        ] {
            column.truncate(100);
        }
        assert_eq!(demand(&log), None);
    }
}
