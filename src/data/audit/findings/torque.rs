//! Findings about a joint's torque.

use super::super::table::short;
use super::super::{Audit, JointAudit};
use super::Severity::{Info, Warning};
use super::{Found, is_passive, milliseconds, percent, spike_severity};

/// Less clipping than this leaves the torque usable as it is logged.
const MUCH_SATURATION: f64 = 0.02;

/// A torque lag below one step cannot be told from how the rows are stamped.
const TORQUE_LAG_STEPS: f64 = 1.0;

impl Found {
    pub(super) fn about_torque(&mut self, joint: &JointAudit, audit: &Audit) {
        let (tau, name) = (&joint.tau, &joint.tau.name);
        if tau.constant {
            self.about_constant_torque(joint);
            return;
        }
        if tau.min >= 0.0 || tau.max <= 0.0 {
            self.add(
                Warning,
                format!(
                    "{name} never changes sign ({} to {} N m): its gain and a constant torque are hard \
                     to tell apart; drive both ways",
                    short(tau.min),
                    short(tau.max)
                ),
            );
        }
        self.about_torque_signal(joint, audit.rows);
        self.about_torque_lag(joint, audit.median_step_s);
    }

    fn about_torque_signal(&mut self, joint: &JointAudit, rows: usize) {
        let (tau, name) = (&joint.tau, &joint.tau.name);
        if tau.saturated_fraction > MUCH_SATURATION {
            self.add(
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
            self.add(
                // Never serious: a command may chatter for good reason.
                spike_severity(tau.spikes, rows).max(Warning),
                format!(
                    "{name} has {} single-row spike(s): an actuator hardly follows them; check whether \
                     the column holds a command or a measurement",
                    tau.spikes
                ),
            );
        }
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
                    "{name} is {} N m throughout: its gain cannot be told from a constant torque; vary it",
                    short(tau.max)
                ),
            );
        }
    }

    fn about_torque_lag(&mut self, joint: &JointAudit, step_s: f64) {
        let Some(lag) = joint.torque_lag else { return };
        if lag.lag_s.abs() >= TORQUE_LAG_STEPS * step_s {
            let verb = if lag.lag_s > 0.0 { "trails" } else { "leads" };
            self.add(
                Info,
                format!(
                    "the acceleration of joint {} {verb} {} by {} ({} steps, correlation {}): a delay of \
                     the actuator or of the time stamps",
                    joint.joint,
                    joint.tau.name,
                    milliseconds(lag.lag_s.abs()),
                    short(lag.lag_s.abs() / step_s),
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
