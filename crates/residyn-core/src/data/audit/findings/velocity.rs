//! Checks of a joint's logged velocity.

use super::Severity::{Info, Warning};
use super::{Finding, JointAudit, Seen, milliseconds, percent, short, spike_severity};
use crate::data::audit::MAX_LAG_S;

/// A scale this far from 1 biases every rate-dependent effect by as much.
const SCALE_OFF: f64 = 0.05;

/// A backward difference lags by half a step; shorter lags are within the error of the estimate.
const LAG_STEPS: f64 = 0.4;

/// A lag up to here is that of a difference.
const HALF_STEPS: f64 = 0.6;

/// A longer lag comes from a filter or a bus, and pairs velocities with the wrong angles.
const LONG_LAG_STEPS: f64 = 1.5;

pub(super) fn scale(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let (name, unit) = (&joint.qd.name, joint.qd.unit);
    let (number, scale) = (joint.joint, joint.velocity?.scale);
    let times = short(scale);
    let text =
        format!("{name} is {times} times dq{number}/dt: check its unit ({unit}) and gear ratio");
    ((scale - 1.0).abs() > SCALE_OFF).then(|| Finding::new(Warning, text))
}

pub(super) fn lag(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (name, number, lag_s) = (&joint.qd.name, joint.joint, joint.velocity?.lag_s);
    let steps = lag_s.abs() / seen.audit.median_step_s;
    let (verb, difference) = match lag_s > 0.0 {
        true => ("trails", "backward"),
        false => ("leads", "forward"),
    };
    let late = milliseconds(lag_s.abs());
    let size = match (steps <= HALF_STEPS, lag_s.abs() >= MAX_LAG_S) {
        (true, _) => {
            format!("{late}, half a step, as a {difference} difference of q{number} does")
        }
        (false, false) => format!("{late}, {} steps: a filter, or another clock", short(steps)),
        (false, true) => format!("at least {late}: a filter, or another clock"),
    };
    let text = format!(
        "{name} {verb} dq{number}/dt by {size}; do not pair it with q{number} of the same row"
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
        "{} has {} sample(s) ({}) that disagree with dq{number}/dt, by up to {} {}: they count in velocity errors; \
         `qd = []` under [columns] takes velocities from q{number}",
        qd.name,
        qd.spikes,
        percent(qd.spikes as f64 / rows as f64),
        short(joint.velocity?.worst_rad_s),
        qd.unit
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
