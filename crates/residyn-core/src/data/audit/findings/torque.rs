//! Findings about a joint's torque.

use super::super::table::short;
use super::super::{Audit, JointAudit};
use super::Severity::{Info, Serious, Warning};
use super::{Found, is_passive, milliseconds, percent, spike_severity};
use crate::data::jumps::rows_that_jump;
use crate::data::log::Log;

/// Less clipping than this leaves the torque usable as logged.
const MUCH_SATURATION: f64 = 0.02;

/// A torque lag below one step cannot be distinguished from the way the rows are stamped.
const TORQUE_LAG_STEPS: f64 = 1.0;

/// A longer lag pairs torques with the wrong accelerations by a good part of a fast motion.
const LONG_LAG_STEPS: f64 = 3.0;

/// Fast content beyond this share of the slow content is reported; beyond the other, the column is mostly noise.
const SOME_CHATTER: f64 = 0.5;
const MUCH_CHATTER: f64 = 1.0;

/// If the motion explains less than this share of a torque's variance, the torque says more about something else.
const WELL_EXPLAINED: f64 = 0.5;

impl Found {
    pub(super) fn about_torque(&mut self, joint: &JointAudit, audit: &Audit, log: &Log) {
        let (tau, name) = (&joint.tau, &joint.tau.name);
        if tau.constant {
            self.about_constant_torque(joint);
            return;
        }
        if tau.min >= 0.0 || tau.max <= 0.0 {
            self.add(
                Warning,
                format!(
                    "{name} never changes sign ({} to {} N m): its gain is hard to distinguish from a constant torque; \
                     drive in both directions",
                    short(tau.min),
                    short(tau.max)
                ),
            );
        }
        self.about_torque_signal(joint, log);
        self.about_chatter(joint);
        self.about_torque_explained(joint);
        self.about_torque_lag(joint, audit.median_step_s);
    }

    fn about_torque_signal(&mut self, joint: &JointAudit, log: &Log) {
        let (tau, name) = (&joint.tau, &joint.tau.name);
        let values = &log.tau[joint.joint];
        if tau.saturated_fraction > MUCH_SATURATION {
            let at_limit = (0..log.rows()).filter(|row| tau.limits.contains(&values[*row]));
            self.add_during(
                &log.intervals(at_limit),
                Warning,
                format!(
                    "{name} sits at an end of its range ({} to {} N m) in {} of the rows: make sure \
                     that the column holds the torque after limiting",
                    short(tau.min),
                    short(tau.max),
                    percent(tau.saturated_fraction)
                ),
            );
        }
        if tau.spikes > 0 {
            self.add_during(
                &log.intervals(rows_that_jump(values)),
                // Never serious: a command may chatter for good reason.
                spike_severity(tau.spikes, log.rows()).max(Warning),
                format!(
                    "{name} has {} single-row spike(s) ({}): too fast for a real actuator; check whether \
                     the column holds a command or a measurement",
                    tau.spikes,
                    percent(tau.spikes as f64 / log.rows() as f64)
                ),
            );
        }
    }

    fn about_chatter(&mut self, joint: &JointAudit) {
        let Some(demand) = joint.torque_demand else {
            return;
        };
        let ratio = demand.fast_nm / demand.slow_nm;
        if ratio < SOME_CHATTER {
            return;
        }
        let (tau, name) = (&joint.tau, &joint.tau.name);
        let far_off = if demand.far_off > 0.0 {
            format!(
                "; {} of the rows, up to {} N m, exceed twice the {} N m that the motion needs at most",
                percent(demand.far_off),
                short(tau.max.max(-tau.min)),
                short(demand.needed_nm)
            )
        } else {
            String::new()
        };
        self.add(
            if ratio > MUCH_CHATTER { Serious } else { Warning },
            format!(
                "{name} chatters: {} N m (root mean square) above {} Hz against {} N m below, {} times as \
                 much{far_off}. Hardly any of it moves the joint, but all of it counts in a least-squares fit of the \
                 torque: record again with softer gains or a smooth command",
                short(demand.fast_nm),
                short(demand.slow_hz),
                short(demand.slow_nm),
                short(ratio)
            ),
        );
    }

    fn about_torque_explained(&mut self, joint: &JointAudit) {
        let Some(demand) = joint.torque_demand else {
            return;
        };
        if demand.explained >= WELL_EXPLAINED {
            return;
        }
        let remedy = if demand.explained_slow >= WELL_EXPLAINED {
            "do not trust parameters from a regression of the torque; fit trajectories, as closeloop does"
        } else {
            "something else moves the joint (a hand, a contact, stiction), or the column does not hold the acting \
             torque; leave such intervals out, or check the column"
        };
        self.add(
            Warning,
            format!(
                "the motion explains {} of the variance of {} as logged and {} of that below {} Hz (regression on \
                 gravity, friction and accelerations): {remedy}",
                percent(demand.explained),
                joint.tau.name,
                percent(demand.explained_slow),
                short(demand.slow_hz)
            ),
        );
    }

    fn about_constant_torque(&mut self, joint: &JointAudit) {
        let (tau, name) = (&joint.tau, &joint.tau.name);
        if is_passive(joint) {
            self.add(
                Info,
                format!(
                    "{name} is zero throughout: joint {} is not driven",
                    joint.joint
                ),
            );
        } else {
            self.add(
                Warning,
                format!(
                    "{name} is {} N m throughout: its gain cannot be distinguished from a constant torque; vary the \
                     torque",
                    short(tau.max)
                ),
            );
        }
    }

    fn about_torque_lag(&mut self, joint: &JointAudit, step_s: f64) {
        let Some(lag) = joint.torque_lag else { return };
        if lag.lag_s.abs() >= TORQUE_LAG_STEPS * step_s {
            let verb = if lag.lag_s > 0.0 { "trails" } else { "leads" };
            let steps = lag.lag_s.abs() / step_s;
            self.add(
                if steps > LONG_LAG_STEPS { Warning } else { Info },
                format!(
                    "the acceleration of joint {} {verb} {} by {} ({} steps, correlation {}): a delay of the actuator \
                     or of the time stamps; shift the column by this much before you compute inertias row by row",
                    joint.joint,
                    joint.tau.name,
                    milliseconds(lag.lag_s.abs()),
                    short(steps),
                    short(lag.correlation)
                ),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::swing;
    use super::super::tests::says;
    use super::*;

    #[test]
    fn torque_that_the_motion_does_not_need_is_reported_with_its_size() {
        let mut log = swing();
        let signs = [30.0, -30.0].into_iter().cycle();
        let chatter = log.tau[0].iter_mut().zip(signs);
        chatter.for_each(|(tau, c)| *tau += c);
        log.tau[0]
            .iter_mut()
            .step_by(50)
            .for_each(|tau| *tau += 100.0);
        assert!(says(
            &log,
            Serious,
            &[
                "tau1 chatters: 3",
                "above 10.6 Hz",
                "2 % of the rows",
                "smooth command"
            ]
        ));
        assert!(says(
            &log,
            Warning,
            &[
                "the motion explains",
                "of tau1 as logged",
                "fit trajectories"
            ]
        ));
    }

    #[test]
    fn a_joint_that_something_else_moves_is_reported() {
        let mut log = swing();
        let strange = |t: f64| 20.0 * (11.0 * t).sin();
        let times = log.time.clone();
        let rows = log.tau[0].iter_mut().zip(times);
        rows.for_each(|(tau, t)| *tau += strange(t) * if t > 2.0 { 2.0 } else { 0.0 });
        assert!(says(
            &log,
            Warning,
            &["the motion explains", "something else moves the joint"]
        ));
    }

    #[test]
    fn a_torque_that_comes_early_is_reported_with_its_remedy() {
        let mut log = swing();
        log.tau[0].rotate_left(5);
        // A second motion, as gravity would explain a single one.
        assert!(says(
            &log,
            Warning,
            &[
                "the acceleration of joint 1 trails tau1 by",
                "shift the column"
            ]
        ));
    }

    #[test]
    fn torques_that_show_little_are_named() {
        let with_tau = |tau: fn(f64) -> f64| {
            let mut log = swing();
            log.tau[0].iter_mut().for_each(|value| *value = tau(*value));
            log
        };
        assert!(says(
            &with_tau(|_| 0.0),
            Info,
            &["passive rig", "ratios to the inertia"]
        ));
        assert!(says(
            &with_tau(|_| 0.3),
            Warning,
            &["tau1 is 0.3 N m throughout"]
        ));
        assert!(says(
            &with_tau(f64::abs),
            Warning,
            &["tau1 never changes sign"]
        ));
        let clipped = with_tau(|tau| tau.clamp(-9.0, 9.0));
        assert!(says(
            &clipped,
            Warning,
            &["tau1 sits at an end of its range (-9 to 9 N m)"]
        ));
    }
}
