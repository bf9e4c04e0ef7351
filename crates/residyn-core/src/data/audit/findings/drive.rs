//! Checks of what drives a joint: its torque, or the command of its drive.

use super::Severity::{Info, Serious, Warning};
use super::{Finding, JointAudit, Seen, is_passive, milliseconds, percent, short, spike_severity};

/// Less clipping than this leaves the torque usable as logged.
const MUCH_SATURATION: f64 = 0.02;

/// A torque lag below one step cannot be distinguished from the way the rows are stamped.
const LAG_STEPS: f64 = 1.0;

/// A longer lag pairs torques with the wrong accelerations by a good part of a fast motion.
const LONG_LAG_STEPS: f64 = 3.0;

/// Fast content beyond this share of the slow content is reported; beyond the other, the column is mostly noise.
const SOME_CHATTER: f64 = 0.5;
const MUCH_CHATTER: f64 = 1.0;

/// If the motion explains less than this share of a torque's variance, the torque says more about something else.
const WELL_EXPLAINED: f64 = 0.5;

pub(super) fn constant_command(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let text = format!(
        "{} is {} throughout: the drive's gains cannot be distinguished from the load; vary the command",
        joint.tau.name,
        short(joint.tau.max)
    );
    let finding = || Finding::new(Warning, text).of(joint.joint);
    joint.tau.constant.then(finding)
}

pub(super) fn constant_torque(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let (number, name) = (joint.joint, &joint.tau.name);
    let (value, unit) = (short(joint.tau.max), joint.tau.unit);
    Some(match is_passive(joint) {
        true => Finding::new(
            Info,
            format!("{name} is zero throughout: joint {number} is not driven"),
        ),
        false => Finding::new(
            Warning,
            format!(
                "{name} is {value} {unit} throughout: its gain cannot be distinguished from a constant torque; vary the \
                 torque"
            ),
        ),
    })
}

pub(super) fn one_sided(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let tau = &joint.tau;
    let text = format!(
        "{} never changes sign ({} to {} {}): its gain is hard to distinguish from a constant torque; drive in both \
         directions",
        tau.name,
        short(tau.min),
        short(tau.max),
        tau.unit
    );
    (tau.min >= 0.0 || tau.max <= 0.0).then(|| Finding::new(Warning, text))
}

pub(super) fn saturated(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (tau, values) = (&joint.tau, &seen.log.tau[joint.joint]);
    if tau.saturated_fraction <= MUCH_SATURATION {
        return None;
    }
    let text = format!(
        "{} sits at an end of its range ({} to {} {}) in {} of the rows: make sure that the column holds the torque \
         after limiting",
        tau.name,
        short(tau.min),
        short(tau.max),
        tau.unit,
        percent(tau.saturated_fraction)
    );
    let at_limit = (0..values.len()).filter(|row| tau.limits.contains(&values[*row]));
    Some(Finding::new(Warning, text).during(&seen.log.intervals(at_limit)))
}

pub(super) fn spikes(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (tau, rows) = (&joint.tau, seen.audit.rows);
    let text = format!(
        "{} has {} single-row spike(s) ({}): too fast for a real actuator; check whether the column holds a command or \
         a measurement",
        tau.name,
        tau.spikes,
        percent(tau.spikes as f64 / rows as f64)
    );
    // Never serious: a command may chatter for good reason.
    let severity = spike_severity(tau.spikes, rows).max(Warning);
    (tau.spikes > 0).then(|| Finding::new(severity, text).during(&joint.spiky))
}

pub(super) fn chatter(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let (tau, demand) = (&joint.tau, joint.torque_demand?);
    let ratio = demand.fast_nm / demand.slow_nm;
    if ratio < SOME_CHATTER {
        return None;
    }
    let unit = tau.unit;
    let far_off = match demand.far_off > 0.0 {
        true => format!(
            "; {} of the rows, up to {} {unit}, exceed twice the {} {unit} that the motion needs at most",
            percent(demand.far_off),
            short(tau.max.max(-tau.min)),
            short(demand.needed_nm)
        ),
        false => String::new(),
    };
    let text = format!(
        "{} chatters: {} {unit} (root mean square) above {} Hz against {} {unit} below, {} times as much{far_off}. Hardly any \
         of it moves the joint, but all of it counts in a least-squares fit of the torque: record again with softer \
         gains or a smooth command",
        tau.name,
        short(demand.fast_nm),
        short(demand.slow_hz),
        short(demand.slow_nm),
        short(ratio)
    );
    let severity = if ratio > MUCH_CHATTER {
        Serious
    } else {
        Warning
    };
    Some(Finding::new(severity, text))
}

pub(super) fn unexplained(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let demand = joint.torque_demand?;
    let remedy = match demand.explained_slow >= WELL_EXPLAINED {
        true => {
            "do not trust parameters from a regression of the torque; fit trajectories, as closeloop does"
        }
        false => {
            "something else moves the joint (a hand, a contact, stiction), or the column does not hold the acting \
             torque; leave such intervals out, or check the column"
        }
    };
    let text = format!(
        "the motion explains {} of the variance of {} as logged and {} of that below {} Hz (regression on gravity, \
         friction and accelerations): {remedy}",
        percent(demand.explained),
        joint.tau.name,
        percent(demand.explained_slow),
        short(demand.slow_hz)
    );
    (demand.explained < WELL_EXPLAINED).then(|| Finding::new(Warning, text))
}

pub(super) fn lag(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (found, step_s) = (joint.torque_lag?, seen.audit.median_step_s);
    let steps = found.lag_s / step_s;
    let text = format!(
        "the acceleration of joint {} trails {} by {} ({} steps, correlation {}): a delay of the actuator or of the \
         time stamps; shift the column by this much before you compute inertias row by row",
        joint.joint,
        joint.tau.name,
        milliseconds(found.lag_s),
        short(steps),
        short(found.correlation)
    );
    let severity = if steps > LONG_LAG_STEPS {
        Warning
    } else {
        Info
    };
    (steps >= LAG_STEPS).then(|| Finding::new(severity, text))
}
