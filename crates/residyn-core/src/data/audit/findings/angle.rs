//! Checks of a joint's angle: how the joint moves, and whether its sensor follows.

use super::Severity::{Info, Serious, Warning};
use super::{Finding, JointAudit, Seen, percent, short, spike_severity};
use crate::data::dropped::DROPPED_STEPS;
use crate::data::jumps::bridge;
use crate::data::local_cubic::half_width_s;
use crate::data::log::{Interval, Log};

/// Beyond this share at rest, most rows show static friction at best.
const MUCH_REST: f64 = 0.5;

/// Beyond this share, the logger reads its source more often than the source changes.
const MANY_REPEATS: f64 = 0.2;

/// Shorter freezes hardly cost a window.
const LONG_S: f64 = 0.05;
const LONG_ROWS: usize = 10;

/// No joint goes from rest to this many times its fast speed in one row.
const TOO_FAST: f64 = 5.0;

/// A change by fewer steps of the resolution than this is rounding.
const VISIBLE_STEPS: f64 = 3.0;

pub(super) fn never_reverses(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let text = format!(
        "{} never reverses: dry friction cannot be distinguished from a constant torque; move in both directions",
        joint.q.name
    );
    (joint.reversals == 0).then(|| Finding::new(Warning, text))
}

pub(super) fn rests(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let (number, share) = (joint.joint, percent(joint.share_at_rest));
    let text = format!("joint {number} is at rest in {share} of the rows");
    let finding = || Finding::new(Info, text).during(&joint.at_rest);
    (joint.share_at_rest > MUCH_REST).then(finding)
}

pub(super) fn repeats(joint: &JointAudit, _: &Seen<'_>) -> Option<Finding> {
    let text = format!(
        "{} repeats the previous row in {} of the rows in motion: the log is written faster than the encoder is read; \
         keep only rows that differ",
        joint.q.name,
        percent(joint.repeated_fraction)
    );
    let finding = || Finding::new(Serious, text).during(&joint.repeated);
    (joint.repeated_fraction > MANY_REPEATS).then(finding)
}

/// An angle that stays the same to the last digit, and then jumps.
pub(super) fn freezes(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    if joint.repeated_fraction > MANY_REPEATS {
        return None;
    }
    let freezes = freezes_of(joint, seen);
    let longest = freezes.iter().map(Interval::length_s).reduce(f64::max)?;
    let text = format!(
        "{} stays the same to the last digit for up to {} s, {} time(s), and then jumps: the sensor or the bus froze; \
         leave out these intervals",
        joint.q.name,
        short(longest),
        freezes.len()
    );
    let finding = Finding::new(Warning, text).of(joint.joint);
    Some(finding.within(&seen.audit.log, &freezes))
}

/// From the first row of each freeze to the one that jumps.
fn freezes_of(joint: &JointAudit, seen: &Seen<'_>) -> Vec<Interval> {
    let (q, time) = (&seen.log.q[joint.joint], &seen.log.time);
    let step_s = seen.audit.median_step_s;
    let jump = (TOO_FAST * joint.fast_rad_s * step_s).max(VISIBLE_STEPS * joint.q.resolution);
    let mut first = 0;
    let mut freezes = Vec::new();
    for row in (1..q.len()).filter(|row| q[*row] != q[*row - 1]) {
        let span = Interval {
            start_s: time[first],
            end_s: time[row],
        };
        let is_long = row - first > LONG_ROWS && span.length_s() > LONG_S;
        let is_whole = time[row] - time[row - 1] < DROPPED_STEPS * step_s;
        if is_long && is_whole && (q[row] - q[row - 1]).abs() > jump {
            freezes.push(span);
        }
        first = row;
    }
    freezes
}

/// Single readings that jump.
pub(super) fn jumps(joint: &JointAudit, seen: &Seen<'_>) -> Option<Finding> {
    let (log, rows) = (seen.log, &joint.jumping);
    let angles = &log.q[joint.joint];
    let first = *rows.first()?;
    let mut without = angles.clone();
    bridge(&log.time, &mut without, rows);
    let sizes = rows.iter().map(|&row| (angles[row] - without[row]).abs());
    let text = format!(
        "{} jumps in {} single row(s) ({}), by up to {} {}, first at t = {} s: masked in fits, counted in errors on \
         test logs; check the encoder's wiring",
        joint.q.name,
        rows.len(),
        percent(rows.len() as f64 / log.rows() as f64),
        short(sizes.fold(0.0, f64::max)),
        joint.q.unit,
        short(log.time[first])
    );
    let severity = spike_severity(rows.len(), log.rows()).min(Warning);
    let around = |&row: &usize| around(log, seen.audit.median_step_s, row);
    let spans: Vec<Interval> = rows.iter().map(around).collect();
    let finding = Finding::new(severity, text).of(joint.joint);
    Some(finding.within(&seen.audit.log, &spans))
}

/// From halfway to the previous row, in digits that a log has, until the row no longer enters a window's start state.
fn around(log: &Log, step_s: f64, row: usize) -> Interval {
    let digits = (1e3 / step_s).log10().ceil().clamp(0.0, 9.0);
    let rounded = |t: f64| (t * 10.0_f64.powf(digits)).round() / 10.0_f64.powf(digits);
    Interval {
        start_s: rounded(0.5 * (log.time[row - 1] + log.time[row])),
        end_s: rounded(log.time[row] + half_width_s(step_s) + 0.5 * step_s),
    }
}
