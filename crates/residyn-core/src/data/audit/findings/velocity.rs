//! Checks of a joint's logged velocity.

use super::Severity::{Info, Warning};
use super::{Finding, JointAudit, Seen, percent, short, spike_severity};
use crate::data::audit::MAX_LAG_S;

/// A scale this far from 1 biases every rate-dependent effect by as much.
const SCALE_OFF: f64 = 0.05;

/// A backward difference lags by 0.5 steps; shorter lags are within the error of the estimate.
const LAG_STEPS: f64 = 0.4;

/// A longer lag comes from a filter or a bus, and pairs velocities with the wrong angles.
const LONG_LAG_STEPS: f64 = 1.5;

pub(super) fn scale(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let (name, number, scale) = (&joint.qd.name, joint.joint, joint.velocity?.scale);
    let times = short(scale);
    let text =
        format!("{name} is {times} times dq{number}/dt: check its unit (rad/s) and gear ratio");
    ((scale - 1.0).abs() > SCALE_OFF).then(|| Finding::new(Warning, text))
}

pub(super) fn lag(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (name, number, lag_s) = (&joint.qd.name, joint.joint, joint.velocity?.lag_s);
    let (verb, late, steps) = super::lag(lag_s, seen.audit.median_step_s);
    let bound = if lag_s.abs() >= MAX_LAG_S {
        "at least "
    } else {
        ""
    };
    let text = format!(
        "{name} {verb} dq{number}/dt by {bound}{late} ({} steps; a backward difference: 0.5): do not pair it with \
         q{number} of the same row",
        short(steps)
    );
    let severity = if steps > LONG_LAG_STEPS {
        Warning
    } else {
        Info
    };
    (steps >= LAG_STEPS).then(|| Finding::new(severity, text))
}

pub(super) fn spikes(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (qd, number, rows) = (&joint.qd, joint.joint, seen.audit.examined_rows);
    let text = format!(
        "{} has {} sample(s) ({}) that disagree with dq{number}/dt, by up to {} rad/s: they count in velocity errors; \
         `qd = []` under [columns] takes velocities from q{number}",
        qd.name,
        qd.spikes,
        percent(qd.spikes as f64 / rows as f64),
        short(joint.velocity?.worst_rad_s)
    );
    // Never serious: fits read no velocities.
    let severity = spike_severity(qd.spikes, rows).max(Warning);
    let finding = || {
        Finding::new(severity, text)
            .of(number)
            .during(&joint.disagreeing)
    };
    (qd.spikes > 0).then(finding)
}
