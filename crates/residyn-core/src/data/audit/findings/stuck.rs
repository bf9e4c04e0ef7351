//! Findings about an angle that freezes: it stays the same to the last digit, and then jumps.

use super::super::JointAudit;
use super::super::quality::Finding;
use super::super::table::short;
use super::Found;
use super::Severity::Warning;
use crate::data::dropped::DROPPED_STEPS;
use crate::data::log::{Interval, Log};

/// Shorter freezes hardly cost a window.
const LONG_S: f64 = 0.05;
const LONG_ROWS: usize = 10;

/// No joint goes from rest to this many times its fast speed in one row.
const TOO_FAST: f64 = 5.0;

/// A change by fewer steps of the resolution than this is rounding.
const VISIBLE_STEPS: f64 = 3.0;

impl Found {
    pub(super) fn about_freezes(&mut self, joint: &JointAudit, log: &Log) {
        let freezes = freezes(joint, log);
        let Some(longest) = freezes.iter().map(Interval::length_s).reduce(f64::max) else {
            return;
        };
        let text = format!(
            "{} stays the same to the last digit for up to {} s, {} time(s), and then jumps: the sensor or the bus \
             froze; leave out these intervals",
            joint.q.name,
            short(longest),
            freezes.len()
        );
        let finding = Finding::new(Warning, text).of(joint.joint);
        self.0.push(finding.within(&log.name(), &freezes));
    }
}

/// From the first row of each freeze to the one that jumps.
fn freezes(joint: &JointAudit, log: &Log) -> Vec<Interval> {
    let (q, step_s) = (&log.q[joint.joint], log.median_step());
    let jump = (TOO_FAST * joint.fast_rad_s * step_s).max(VISIBLE_STEPS * joint.q.resolution);
    let mut first = 0;
    let mut freezes = Vec::new();
    for row in 1..log.rows() {
        if q[row] == q[row - 1] {
            continue;
        }
        let span = Interval {
            start_s: log.time[first],
            end_s: log.time[row],
        };
        let is_long = row - first > LONG_ROWS && span.length_s() > LONG_S;
        let is_whole = log.time[row] - log.time[row - 1] < DROPPED_STEPS * step_s;
        if is_long && is_whole && (q[row] - q[row - 1]).abs() > jump {
            freezes.push(span);
        }
        first = row;
    }
    freezes
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::swing;
    use super::super::tests::{says, spans};
    use super::*;

    #[test]
    fn a_sensor_that_froze_is_reported_with_its_time() {
        let mut log = swing();
        let held = log.q[0][1000];
        log.q[0][1000..1200].fill(held);
        let words = [
            "q1 stays the same",
            "for up to 0.4 s, 1 time(s)",
            "rig.csv@2-2.4",
        ];
        assert!(says(&log, Warning, &words));
        let ends = [log.time[1000], log.time[1200]];
        assert_eq!(spans(&log, "q1 stays the same"), [ends]);
        // A joint that rests and then moves off does not jump.
        let mut resting = swing();
        let moved = resting.q[0].clone();
        let start = moved[0];
        resting.q[0][..1000].fill(start);
        resting.q[0][1000..].copy_from_slice(&moved[..4000]);
        assert!(!says(&resting, Warning, &["q1 stays the same"]));
    }
}
