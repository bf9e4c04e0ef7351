//! Checks of a log as a whole: how it was read and sampled, and how much of it is motion.

use super::Severity::{Info, Serious, Warning};
use super::{Finding, JointAudit, Seen, milliseconds, percent, short};
use crate::data::dropped::dropped;
use crate::data::log::{Interval, Log};
use crate::data::repeated::longest_run;

/// Motion for less than this \[s\] is fewer than eight intervals of half a second, too few to distinguish effects.
const LITTLE_MOTION_S: f64 = 4.0;

/// Below this \[s\] not even one window of 0.5 s fits.
const TOO_LITTLE_MOTION_S: f64 = 0.5;

/// Beyond this about one step in ten overruns by a large part of a step, and lags of about one step
/// cannot be resolved.
const LARGE_JITTER: f64 = 0.05;

/// A smaller share of dropped rows hardly costs a window.
const FEW_DROPPED: f64 = 0.001;

pub(super) fn left_out(seen: &Seen<'_>) -> Option<Finding> {
    let spans: Vec<String> = seen.log.leave_out.iter().map(Interval::to_string).collect();
    let text = format!("left out, but audited: {}", spans.join(", "));
    (!spans.is_empty()).then(|| Finding::new(Info, text))
}

pub(super) fn examined(seen: &Seen<'_>) -> Option<Finding> {
    let (rows, examined) = (seen.audit.rows, seen.audit.examined_rows);
    let text = format!(
        "noise, resolution and motion are estimated from {examined} of the {rows} rows, in intervals spread evenly \
         over the log; ranges, jumps, gaps and missing rows from all of them"
    );
    (examined < rows).then(|| Finding::new(Info, text))
}

pub(super) fn gaps(seen: &Seen<'_>) -> Option<Finding> {
    let gaps = &seen.audit.gaps;
    let by_length = |a: &&Interval, b: &&Interval| a.length_s().total_cmp(&b.length_s());
    let longest = gaps.iter().max_by(by_length)?;
    let text = format!(
        "{} gap(s), the longest of {} s at t = {} s: no window spans them, but the first rows after a gap say little \
         about how the joints move; leave them out",
        gaps.len(),
        short(longest.length_s()),
        short(longest.start_s)
    );
    Some(Finding::new(Warning, text).within(&seen.audit.log, gaps))
}

pub(super) fn dropped_rows(seen: &Seen<'_>) -> Option<Finding> {
    let count = seen.audit.dropped_rows;
    if count == 0 {
        return None;
    }
    let share = count as f64 / seen.audit.rows as f64;
    let text = format!(
        "{count} row(s) are missing ({} of the number logged): the torque in between is unknown. Fits interpolate it, \
         and leave out steps in which it jumps; errors hold the last logged torque and therefore grow",
        percent(share)
    );
    let severity = if share > FEW_DROPPED { Warning } else { Info };
    let steps = dropped(seen.log).into_iter().map(|step| step.row);
    Some(Finding::new(severity, text).during(&seen.log.intervals(steps)))
}

/// These rows repeat the readings of the row before.
pub(in super::super) fn repeated_readings(log: &Log, rows: &[usize]) -> Option<Finding> {
    let share = rows.len() as f64 / log.rows() as f64;
    let text = format!(
        "all angles repeat the row before in {} row(s) in motion ({} of the rows, up to {} in a row) and then jump: the \
         bus answered with its last readings. Masked in fits, counted in errors on test logs",
        rows.len(),
        percent(share),
        longest_run(rows)
    );
    let severity = if share > FEW_DROPPED { Warning } else { Info };
    let finding = || Finding::new(severity, text).during(&log.intervals(rows.iter().copied()));
    (!rows.is_empty()).then(finding)
}

pub(super) fn jitter(seen: &Seen<'_>) -> Option<Finding> {
    let audit = seen.audit;
    let text = format!(
        "the steps vary by {} of their median ({} to {}): delays shorter than the longest step cannot be trusted; log \
         from a real-time loop",
        percent(audit.jitter),
        milliseconds(audit.min_step_s),
        milliseconds(audit.max_step_s)
    );
    (audit.jitter > LARGE_JITTER).then(|| Finding::new(Warning, text))
}

pub(super) fn little_motion(seen: &Seen<'_>) -> Option<Finding> {
    let moving_s = |joint: &JointAudit| seen.audit.duration_s * (1.0 - joint.share_at_rest);
    let motion_s = seen.audit.joints.iter().map(moving_s).fold(0.0, f64::max);
    let severity = match motion_s {
        none if none < TOO_LITTLE_MOTION_S => Serious,
        little if little < LITTLE_MOTION_S => Warning,
        _ => return None,
    };
    let text = format!(
        "only {} s of motion, {} intervals of half a second: too few to distinguish effects; add logs, or record for \
         longer",
        short(motion_s),
        (motion_s / 0.5).floor()
    );
    Some(Finding::new(severity, text))
}

pub(super) fn passive(seen: &Seen<'_>) -> Option<Finding> {
    let text = "all torques are zero throughout: on a passive rig, only ratios to the inertia can be identified";
    seen.is_passive().then(|| Finding::new(Info, text))
}
