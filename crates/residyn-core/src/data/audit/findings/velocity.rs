//! Findings about a joint's logged velocity.

use super::super::quality::Finding;
use super::super::table::short;
use super::super::{Audit, JointAudit, MAX_LAG_S, VelocityCheck};
use super::Severity::{Info, Warning};
use super::{Found, milliseconds, percent, spike_severity};
use crate::data::Joint;

/// A scale this far from 1 biases every rate-dependent effect by as much.
const SCALE_OFF: f64 = 0.05;

/// A backward difference lags by 0.5 steps; shorter lags are within the error of the estimate.
const LAG_STEPS: f64 = 0.4;

/// A longer lag comes from a filter or a bus, and pairs velocities with the wrong angles.
const LONG_LAG_STEPS: f64 = 1.5;

impl Found {
    pub(super) fn about_velocity(&mut self, joint: &JointAudit, audit: &Audit) {
        let (name, number) = (&joint.qd.name, joint.joint);
        let Some(check) = joint.velocity else { return };
        self.about_velocity_scale(name, number, check);
        self.about_velocity_lag(name, number, check, audit.median_step_s);
        if joint.qd.spikes > 0 {
            self.about_velocity_spikes(joint, check, audit.examined_rows);
        }
    }

    fn about_velocity_spikes(&mut self, joint: &JointAudit, check: VelocityCheck, rows: usize) {
        let (name, number) = (&joint.qd.name, joint.joint);
        // Never serious: fits read no velocities.
        let severity = spike_severity(joint.qd.spikes, rows).max(Warning);
        let text = format!(
            "{name} has {} sample(s) ({}) that disagree with dq{number}/dt, by up to {} rad/s: they count in velocity \
             errors; `qd = []` under [columns] takes velocities from q{number}",
            joint.qd.spikes,
            percent(joint.qd.spikes as f64 / rows as f64),
            short(check.worst_rad_s)
        );
        let finding = Finding::new(severity, text).of(number);
        self.0.push(finding.during(&joint.disagreeing));
    }

    fn about_velocity_scale(&mut self, name: &str, number: Joint, check: VelocityCheck) {
        if (check.scale - 1.0).abs() > SCALE_OFF {
            self.add(
                Warning,
                format!(
                    "{name} is {} times dq{number}/dt: check its unit (rad/s) and gear ratio",
                    short(check.scale)
                ),
            );
        }
    }

    fn about_velocity_lag(&mut self, name: &str, number: Joint, check: VelocityCheck, step_s: f64) {
        let steps = check.lag_s.abs() / step_s;
        if steps < LAG_STEPS {
            return;
        }
        let verb = if check.lag_s > 0.0 { "trails" } else { "leads" };
        let bound = if check.lag_s.abs() >= MAX_LAG_S {
            "at least "
        } else {
            ""
        };
        self.add(
            if steps > LONG_LAG_STEPS { Warning } else { Info },
            format!(
                "{name} {verb} dq{number}/dt by {bound}{} ({} steps; a backward difference: 0.5): do \
                 not pair it with q{number} of the same row",
                milliseconds(check.lag_s.abs()),
                short(steps)
            ),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::swing;
    use super::super::tests::says;
    use super::*;

    #[test]
    fn velocities_that_disagree_in_single_rows_are_counted() {
        let with_qd = |change: fn(usize, f64) -> f64| {
            let mut log = swing();
            let numbered = log.qd[0].iter_mut().enumerate();
            numbered.for_each(|(row, value)| *value = change(row, *value));
            log
        };
        let spiky = with_qd(|row, v| if row % 500 == 250 { v + 9.0 } else { v });
        assert!(says(&spiky, Warning, &["qd1 has 10 sample(s)", "up to 9"]));
    }
}
