//! What the measured quality of a log means for fitting a model to it, in plain sentences.

mod command;
mod jumps;
mod torque;
mod velocity;

use super::joint::{JointAudit, VISIBLE_STEPS};
use super::quality::{Audit, Finding, Severity};
use super::table::short;
use crate::data::column::Quantity;
use crate::data::log::{Interval, Log};
use Severity::{Info, Serious, Warning};

/// Motion for less than this \[s\] is fewer than eight stretches of half a second, which tell no effects apart.
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

/// Beyond this share at rest most rows show static friction at best.
const MUCH_REST: f64 = 0.5;

/// Beyond this share the logger reads its source more often than that changes.
const MANY_REPEATS: f64 = 0.2;

/// A smaller share of dropped rows costs hardly a window.
const FEW_DROPPED: f64 = 0.001;

/// All findings about a log, in the order of the joints.
pub(super) fn of(audit: &Audit, log: &Log) -> Vec<Finding> {
    let mut found = Found(vec![]);
    found.about_reading(log);
    found.about_sampling(audit);
    found.about_amount_of_motion(audit);
    let by_torque = log.driven_by == Quantity::Torque;
    let passive = by_torque && audit.joints.iter().all(is_passive);
    if passive {
        found.add(Info, "all torques are zero throughout: a passive rig; only ratios to the inertia can be found");
    }
    for joint in &audit.joints {
        if !by_torque {
            found.about_command(joint);
        } else if !passive {
            found.about_torque(joint, audit);
        }
        if found.moves(joint) {
            found.about_excitation(joint);
            found.about_angle(joint);
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

    /// A finding about one joint.
    fn add_of(&mut self, joint: &JointAudit, severity: Severity, text: impl Into<String>) {
        self.0.push(Finding {
            joint: Some(joint.joint),
            ..Finding::new(severity, text)
        });
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

    fn about_sampling(&mut self, audit: &Audit) {
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
                "{} gap(s), the longest of {} s at t = {} s: no window spans them, but the first rows after a gap tell \
                 little of how the joints move; leave them out",
                gaps.len(),
                short(longest.length_s()),
                short(longest.start_s)
            );
            self.0
                .push(Finding::new(Warning, text).within(&audit.log, gaps));
        }
        self.about_dropped_rows(audit);
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

    fn about_dropped_rows(&mut self, audit: &Audit) {
        let share = audit.dropped_rows as f64 / audit.rows as f64;
        if audit.dropped_rows == 0 {
            return;
        }
        self.add(
            if share > FEW_DROPPED { Warning } else { Info },
            format!(
                "{} row(s) are missing ({} as many as there are): the torque meanwhile is not known. Fits continue it \
                 smoothly, and leave out steps in which it jumps; errors hold it from the row before, and so grow",
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
                "only {} s of motion, {} stretches of half a second: too few to tell effects apart; add logs, or record \
                 for longer",
                short(motion_s),
                (motion_s / 0.5).floor()
            ),
        );
    }

    /// Whether a joint moves at all; says so if not.
    fn moves(&mut self, joint: &JointAudit) -> bool {
        if !joint.moves() {
            self.add_of(
                joint,
                Serious,
                format!(
                    "joint {} moves by {} rad, less than {VISIBLE_STEPS} resolution steps or noise \
                     deviations: its parameters will not be identifiable from this log",
                    joint.joint,
                    short(joint.q.range())
                ),
            );
        }
        joint.moves()
    }

    fn about_excitation(&mut self, joint: &JointAudit) {
        let name = &joint.q.name;
        if joint.reversals == 0 {
            self.add(
                Warning,
                format!(
                    "{name} never reverses: dry friction cannot be told from a constant torque; move \
                     in both directions"
                ),
            );
        }
        if joint.share_at_rest > MUCH_REST {
            self.add(
                Info,
                format!(
                    "joint {} is at rest in {} of the rows",
                    joint.joint,
                    percent(joint.share_at_rest)
                ),
            );
        }
    }

    fn about_angle(&mut self, joint: &JointAudit) {
        let name = &joint.q.name;
        if joint.repeated_fraction > MANY_REPEATS {
            self.add(
                Serious,
                format!(
                    "{name} repeats the row before in {} of the rows in motion: the log is written \
                     faster than the encoder is read; keep only rows that differ",
                    percent(joint.repeated_fraction)
                ),
            );
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::tests::{audit, one_joint, swing};
    use super::*;

    /// Whether the audit says something of this severity that holds all the given words.
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
