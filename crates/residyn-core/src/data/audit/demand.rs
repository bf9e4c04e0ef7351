//! How the logged torque compares with what the motion needs.

use serde::Serialize;

use super::regression::Regression;
use crate::data::local_cubic::LocalCubic;
use crate::data::projection::{difference, explained_by, unexplained};
use crate::data::statistics::{deviation, rms};

/// Rows beyond this many times the largest torque that the motion needs count as far off.
const FAR_OFF: f64 = 2.0;

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

/// Compares one joint's torque with its motion, which is smoothed over `half_width_s` on either side; `None` if the
/// torque is constant.
pub(super) fn torque_demand(
    regression: &Regression<'_>,
    half_width_s: f64,
) -> Option<TorqueDemand> {
    let motion = regression.motion;
    let basis = || regression.basis.iter().chain(&regression.acceleration);
    let (slow, logged) = (&motion.tau, &motion.tau_logged);
    let (about_mean, of_logged) = (deviation(slow), deviation(logged));
    let is_constant = logged.windows(2).all(|pair| pair[0] == pair[1]);
    // The squares of very small torques are zero as well.
    if is_constant || about_mean == 0.0 || of_logged == 0.0 {
        return None;
    }
    let needed = explained_by(basis(), slow);
    let needed_nm = needed.iter().fold(0.0_f64, |top, tau| top.max(tau.abs()));
    let far = |tau: &&f64| tau.abs() > FAR_OFF * needed_nm;
    let left = |rest: &[f64], of: f64| (rms(rest) / of).powi(2);
    Some(TorqueDemand {
        slow_hz: LocalCubic::cutoff_hz(half_width_s),
        slow_nm: about_mean,
        fast_nm: rms(&difference(logged, slow)),
        needed_nm,
        far_off: logged.iter().filter(far).count() as f64 / logged.len() as f64,
        explained_slow: 1.0 - left(&difference(slow, &needed), about_mean),
        explained: 1.0 - left(&unexplained(basis(), logged), of_logged),
    })
}

#[cfg(test)]
mod tests {
    use super::super::joint::audit_joints;
    use super::super::tests::{each, edited, swing};
    use super::TorqueDemand;
    use crate::data::Columns;
    use crate::data::log::Log;

    fn demand(log: &Log) -> Option<TorqueDemand> {
        audit_joints(log, &Columns::default())
            .0
            .remove(0)
            .torque_demand
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
        // +-30 N m from row to row: 250 Hz.
        let sign = |row: usize| if row.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut log = edited(|log| each(&mut log.tau[0], |row, tau| tau + 30.0 * sign(row)));
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
        assert_eq!(demand(&edited(|log| log.tau[0].fill(0.7))), None);
        assert_eq!(demand(&swing().at(std::slice::from_ref(&(0..100)))), None);
    }
}
