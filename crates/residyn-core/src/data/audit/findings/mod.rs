//! What the measured quality of a log means for fitting a model to it, in plain sentences.

mod command;
mod jumps;
mod stuck;
mod torque;
mod velocity;

use super::joint::JointAudit;
use super::quality::{Audit, Finding, Severity};
use super::table::short;
use crate::data::column::Quantity;
use crate::data::dropped::dropped;
use crate::data::log::{Interval, Log};
use Severity::{Info, Serious, Warning};

/// Motion for less than this \[s\] is fewer than eight intervals of half a second, too few to distinguish effects.
const LITTLE_MOTION_S: f64 = 4.0;

/// Below this \[s\] not even one window of 0.5 s fits.
const TOO_LITTLE_MOTION_S: f64 = 0.5;

/// Beyond this about one step in ten overruns by a large part of a step, and lags of about one step
/// cannot be resolved.
const LARGE_JITTER: f64 = 0.05;

/// With a larger share of bad rows, masking single rows does not save a column.
const MANY_SPIKES: f64 = 0.01;

/// A smaller share of bad rows does not affect a robust fit.
const SOME_SPIKES: f64 = 0.001;

/// Beyond this share at rest, most rows show static friction at best.
const MUCH_REST: f64 = 0.5;

/// Beyond this share, the logger reads its source more often than the source changes.
const MANY_REPEATS: f64 = 0.2;

/// A smaller share of dropped rows hardly costs a window.
const FEW_DROPPED: f64 = 0.001;

/// All findings about a log, in the order of the joints.
pub(super) fn of(audit: &Audit, log: &Log) -> Vec<Finding> {
    let mut found = Found(vec![]);
    found.about_reading(log);
    found.about_examined(audit);
    found.about_sampling(audit, log);
    found.about_amount_of_motion(audit);
    let by_torque = log.driven_by == Quantity::Torque;
    let passive = by_torque && audit.joints.iter().all(is_passive);
    if passive {
        found.add(
            Info,
            "all torques are zero throughout: on a passive rig, only ratios to the inertia can be identified",
        );
    }
    for joint in &audit.joints {
        if !by_torque {
            found.about_command(joint);
        } else if !passive {
            found.about_torque(joint, audit, log);
        }
        if joint.moves() {
            found.about_excitation(joint);
            found.about_angle(joint, log);
            found.about_jumps(joint, log);
            found.about_velocity(joint, audit);
        }
    }
    found.0
}

fn is_passive(joint: &JointAudit) -> bool {
    joint.tau.constant && joint.tau.max == 0.0
}

fn percent(share: f64) -> String {
    format!("{} %", short(100.0 * share))
}

fn milliseconds(time_s: f64) -> String {
    format!("{} ms", short(1e3 * time_s))
}

/// How much a number of bad rows matters.
fn spike_severity(spikes: usize, rows: usize) -> Severity {
    let share = spikes as f64 / rows as f64;
    if share > MANY_SPIKES {
        Serious
    } else if share > SOME_SPIKES {
        Warning
    } else {
        Info
    }
}

struct Found(Vec<Finding>);

impl Found {
    fn add(&mut self, severity: Severity, text: impl Into<String>) {
        self.0.push(Finding::new(severity, text));
    }

    /// A finding about intervals of the log.
    fn add_during(&mut self, spans: &[Interval], severity: Severity, text: impl Into<String>) {
        self.0.push(Finding::new(severity, text).during(spans));
    }

    /// A finding about one joint.
    fn add_of(&mut self, joint: &JointAudit, severity: Severity, text: impl Into<String>) {
        self.0.push(Finding::new(severity, text).of(joint.joint));
    }

    fn about_reading(&mut self, log: &Log) {
        for note in &log.notes {
            self.add(Info, note.clone());
        }
        if !log.leave_out.is_empty() {
            let intervals: Vec<String> = log.leave_out.iter().map(Interval::to_string).collect();
            self.add(
                Info,
                format!("left out, but audited: {}", intervals.join(", ")),
            );
        }
    }

    fn about_examined(&mut self, audit: &Audit) {
        let Audit {
            rows,
            examined_rows,
            ..
        } = audit;
        if examined_rows < rows {
            self.add(
                Info,
                format!(
                    "noise, resolution and motion are estimated from {examined_rows} of the {rows} rows, in intervals \
                     spread evenly over the log; ranges, jumps, gaps and missing rows from all of them"
                ),
            );
        }
    }

    fn about_sampling(&mut self, audit: &Audit, log: &Log) {
        let Audit {
            gaps,
            jitter,
            min_step_s,
            max_step_s,
            ..
        } = audit;
        if let Some(longest) = gaps
            .iter()
            .max_by(|a, b| a.length_s().total_cmp(&b.length_s()))
        {
            let text = format!(
                "{} gap(s), the longest of {} s at t = {} s: no window spans them, but the first rows after a gap say \
                 little about how the joints move; leave them out",
                gaps.len(),
                short(longest.length_s()),
                short(longest.start_s)
            );
            self.0
                .push(Finding::new(Warning, text).within(&audit.log, gaps));
        }
        self.about_dropped_rows(audit, log);
        if *jitter > LARGE_JITTER {
            self.add(
                Warning,
                format!(
                    "the steps vary by {} of their median ({} to {}): delays shorter than the longest \
                     step cannot be trusted; log from a real-time loop",
                    percent(*jitter),
                    milliseconds(*min_step_s),
                    milliseconds(*max_step_s)
                ),
            );
        }
    }

    fn about_dropped_rows(&mut self, audit: &Audit, log: &Log) {
        let share = audit.dropped_rows as f64 / audit.rows as f64;
        if audit.dropped_rows == 0 {
            return;
        }
        let steps = dropped(log);
        self.add_during(
            &log.intervals(steps.iter().map(|step| step.row)),
            if share > FEW_DROPPED { Warning } else { Info },
            format!(
                "{} row(s) are missing ({} of the number logged): the torque in between is unknown. Fits interpolate \
                 it, and leave out steps in which it jumps; errors hold the last logged torque and therefore grow",
                audit.dropped_rows,
                percent(share)
            ),
        );
    }

    fn about_amount_of_motion(&mut self, audit: &Audit) {
        let moving_s = |joint: &JointAudit| audit.duration_s * (1.0 - joint.share_at_rest);
        let motion_s = audit.joints.iter().map(moving_s).fold(0.0, f64::max);
        let severity = if motion_s < TOO_LITTLE_MOTION_S {
            Serious
        } else if motion_s < LITTLE_MOTION_S {
            Warning
        } else {
            return;
        };
        self.add(
            severity,
            format!(
                "only {} s of motion, {} intervals of half a second: too few to distinguish effects; add logs, or \
                 record for longer",
                short(motion_s),
                (motion_s / 0.5).floor()
            ),
        );
    }

    fn about_excitation(&mut self, joint: &JointAudit) {
        let name = &joint.q.name;
        if joint.reversals == 0 {
            self.add(
                Warning,
                format!(
                    "{name} never reverses: dry friction cannot be distinguished from a constant torque; move in both \
                     directions"
                ),
            );
        }
        if joint.share_at_rest > MUCH_REST {
            self.add_during(
                &joint.at_rest,
                Info,
                format!(
                    "joint {} is at rest in {} of the rows",
                    joint.joint,
                    percent(joint.share_at_rest)
                ),
            );
        }
    }

    fn about_angle(&mut self, joint: &JointAudit, log: &Log) {
        let name = &joint.q.name;
        if joint.repeated_fraction > MANY_REPEATS {
            self.add_during(
                &joint.repeated,
                Serious,
                format!(
                    "{name} repeats the previous row in {} of the rows in motion: the log is written faster than the \
                     encoder is read; keep only rows that differ",
                    percent(joint.repeated_fraction)
                ),
            );
        } else {
            self.about_freezes(joint, log);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::tests::{audit, one_joint, swing};
    use super::*;

    /// Whether the audit has a finding of this severity that contains all the given words.
    pub(in super::super) fn says(log: &Log, severity: Severity, words: &[&str]) -> bool {
        let audit = audit(log);
        let fits = |finding: &Finding| {
            let remedy = finding.remedy.as_ref().map(ToString::to_string);
            let whole = format!("{} {}", finding.text, remedy.unwrap_or_default());
            finding.severity == severity && words.iter().all(|word| whole.contains(word))
        };
        audit.findings.iter().any(fits)
    }

    #[test]
    fn a_good_log_draws_no_warning() {
        let findings = audit(&swing()).findings;
        assert!(
            findings.iter().all(|finding| finding.severity == Info),
            "{findings:?}"
        );
    }

    #[test]
    fn motions_that_show_little_are_named() {
        let time: Vec<f64> = (0..700).map(|i| i as f64 * 0.002).collect();
        let log = one_joint(time.clone(), time.clone(), vec![1.0; 700], time.clone());
        assert!(says(&log, Warning, &["q1 never reverses"]));
        assert!(says(&log, Warning, &["only 1.398", "s of motion"]));
        let still = one_joint(time.clone(), vec![0.5; 700], vec![0.0; 700], time);
        assert!(says(&still, Serious, &["joint 1 moves by 0 rad"]));
    }

    /// The intervals of the finding that says this.
    pub(super) fn spans(log: &Log, words: &str) -> Vec<[f64; 2]> {
        let findings = audit(log).findings;
        let mut said = findings
            .iter()
            .filter(|finding| finding.text.contains(words));
        said.next()
            .unwrap_or_else(|| panic!("{words}: {findings:?}"))
            .spans_s
            .clone()
    }

    #[test]
    fn what_belongs_to_a_part_of_a_log_says_from_when_to_when() {
        let part = 1000..1600;
        let time = swing().time;
        let near = |spans: &[[f64; 2]], from: usize, to: usize| {
            let ends = [time[from], time[to]];
            spans
                .iter()
                .any(|span| (0..2).all(|k| (span[k] - ends[k]).abs() < 0.05))
        };
        let mut clipped = swing();
        clipped.tau[0][part.clone()].fill(40.0);
        assert!(near(&spans(&clipped, "tau1 sits at an end"), 1000, 1600));
        let mut stuck = swing();
        let exact = stuck.q[0].clone();
        (0..3000).for_each(|row| stuck.q[0][row] = exact[row - row % 2]);
        // Except where the joint reverses.
        let repeated = spans(&stuck, "q1 repeats the previous row");
        let length_s: f64 = repeated.iter().map(|[start, end]| end - start).sum();
        assert!(
            length_s > 0.7 * 6.0 && repeated.iter().all(|span| span[1] < 6.05),
            "{repeated:?}"
        );
        let mut resting = swing();
        for row in 1000..5000 {
            resting.q[0][row] = resting.q[0][1000];
            resting.qd[0][row] = 0.0;
        }
        assert!(near(&spans(&resting, "at rest in"), 1000, 4999));
        let mut thinned = swing();
        for channel in [
            &mut thinned.time,
            &mut thinned.q[0],
            &mut thinned.qd[0],
            &mut thinned.tau[0],
        ] {
            channel.remove(2000);
        }
        let missing = spans(&thinned, "1 row(s) are missing");
        assert_eq!(missing, [[time[1999], time[2001]]]);
        let mut spiky = swing();
        spiky.tau[0][700] += 500.0;
        assert_eq!(
            spans(&spiky, "tau1 has 1 single-row spike"),
            [[time[700], time[701]]]
        );
        let mut off = swing();
        off.qd[0][900] += 9.0;
        let disagrees = spans(&off, "qd1 has 1 sample(s)");
        assert_eq!(disagrees, [[time[900], time[901]]]);
        let message = audit(&clipped).to_string();
        let line = message.lines().find(|line| line.contains("t = 2 to 3.2 s"));
        assert!(
            line.is_some_and(|line| line.starts_with("         ")),
            "{message}"
        );
    }

    #[test]
    fn sampling_faults_come_with_their_remedy() {
        let mut log = swing();
        log.time.iter_mut().skip(2500).for_each(|t| *t += 0.2);
        assert!(says(
            &log,
            Warning,
            &[
                "1 gap(s), the longest of 0.202 s at t = 4.998 s",
                "rig.csv@4.998-"
            ]
        ));
        let every = |row: &usize| row % 100 != 50;
        let rows: Vec<usize> = (0..log.rows()).filter(every).collect();
        let thinned = |values: &[f64]| rows.iter().map(|row| values[*row]).collect::<Vec<f64>>();
        let dropped = one_joint(
            thinned(&log.time),
            thinned(&log.q[0]),
            thinned(&log.qd[0]),
            thinned(&log.tau[0]),
        );
        assert!(says(
            &dropped,
            Warning,
            &["50 row(s) are missing", "1.01 %"]
        ));
        log.notes.push("columns ignored: \"mode\"".to_owned());
        assert!(says(&log, Info, &["columns ignored"]));
    }
}
