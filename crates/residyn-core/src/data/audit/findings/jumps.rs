//! Findings about single readings of an angle that jump.

use super::super::JointAudit;
use super::super::quality::Finding;
use super::super::table::short;
use super::Severity::Warning;
use super::{Found, percent, spike_severity};
use crate::data::jumps::{bridge, rows_that_jump};
use crate::data::local_cubic::half_width_s;
use crate::data::log::{Interval, Log};

impl Found {
    pub(super) fn about_jumps(&mut self, joint: &JointAudit, log: &Log) {
        let angles = &log.q[joint.joint];
        let rows = rows_that_jump(angles);
        let Some(&first) = rows.first() else { return };
        let mut without = angles.clone();
        bridge(&log.time, &mut without, &rows);
        let sizes = rows.iter().map(|&row| (angles[row] - without[row]).abs());
        let share = rows.len() as f64 / log.rows() as f64;
        let text = format!(
            "{} jumps in {} single row(s) ({}), by up to {} rad, first at t = {} s: masked in fits, counted in errors \
             on test logs; check the encoder's wiring",
            joint.q.name,
            rows.len(),
            percent(share),
            short(sizes.fold(0.0, f64::max)),
            short(log.time[first])
        );
        let severity = spike_severity(rows.len(), log.rows()).min(Warning);
        let step_s = log.median_step();
        let spans = rows.iter().map(|&row| around(log, step_s, row));
        let spans: Vec<Interval> = spans.collect();
        let finding = Finding::new(severity, text).of(joint.joint);
        self.0.push(finding.within(&log.name(), &spans));
    }
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

#[cfg(test)]
mod tests {
    use super::super::super::tests::swing;
    use super::super::tests::says;
    use super::*;

    #[test]
    fn a_jump_is_placed_and_spoils_no_other_finding() {
        let mut log = swing();
        log.q[0][1500] += 50.0;
        let words = [
            "q1 jumps in 1 single row(s)",
            "up to 50 rad",
            "rig.csv@2.999-3.017",
        ];
        assert!(says(&log, Warning, &words));
        assert!(!says(&log, super::super::Severity::Serious, &[]));
    }
}
