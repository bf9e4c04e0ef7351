//! What the measured quality of a log means for fitting a model to it, in plain sentences: two tables of checks, each
//! run in turn.

mod angle;
mod drive;
mod velocity;
mod whole;

pub(super) use whole::repeated_readings;

use super::joint::JointAudit;
use super::quality::{Audit, Finding, Severity};
use super::table::short;
use crate::data::column::Quantity;
use crate::data::log::Log;
use Severity::{Info, Serious, Warning};

/// With a larger share of bad rows, masking single rows does not save a column.
const MANY_SPIKES: f64 = 0.01;

/// A smaller share of bad rows does not affect a robust fit.
const SOME_SPIKES: f64 = 0.001;

/// A log as it is meant, and what was measured of it.
struct Seen<'a> {
    log: &'a Log,
    audit: &'a Audit,
}

type JointCheck = fn(&JointAudit, &Seen<'_>) -> Option<Finding>;

/// The joints that a check looks at.
enum Of {
    Command,
    ConstantTorque,
    Torque,
    Motion,
    Velocity,
}

/// The checks of a log as a whole.
static LOG_CHECKS: [fn(&Seen<'_>) -> Option<Finding>; 7] = [
    whole::left_out,
    whole::examined,
    whole::gaps,
    whole::dropped_rows,
    whole::jitter,
    whole::little_motion,
    whole::passive,
];

/// The checks of each joint.
static JOINT_CHECKS: [(Of, JointCheck); 16] = [
    (Of::Command, drive::constant_command),
    (Of::ConstantTorque, drive::constant_torque),
    (Of::Torque, drive::one_sided),
    (Of::Torque, drive::saturated),
    (Of::Torque, drive::spikes),
    (Of::Torque, drive::chatter),
    (Of::Torque, drive::unexplained),
    (Of::Torque, drive::lag),
    (Of::Motion, angle::never_reverses),
    (Of::Motion, angle::rests),
    (Of::Motion, angle::repeats),
    (Of::Motion, angle::freezes),
    (Of::Motion, angle::jumps),
    (Of::Velocity, velocity::scale),
    (Of::Velocity, velocity::lag),
    (Of::Velocity, velocity::spikes),
];

/// All findings about a log, in the order of the joints.
pub(super) fn of(audit: &Audit, log: &Log) -> Vec<Finding> {
    let seen = &Seen { log, audit };
    let notes = log.notes.iter().map(|note| Finding::new(Info, note));
    let whole = LOG_CHECKS.iter().filter_map(|check| check(seen));
    let joints = audit.joints.iter().flat_map(|joint| {
        let checks = JOINT_CHECKS
            .iter()
            .filter(move |(of, _)| seen.has(of, joint));
        checks.filter_map(move |(_, check)| check(joint, seen))
    });
    notes.chain(whole).chain(joints).collect()
}

impl Seen<'_> {
    fn has(&self, of: &Of, joint: &JointAudit) -> bool {
        let is_torque = self.audit.driven_by == Quantity::Torque;
        match of {
            Of::Command => !is_torque,
            Of::ConstantTorque => is_torque && joint.tau.constant && !self.is_passive(),
            Of::Torque => is_torque && !joint.tau.constant,
            Of::Motion => joint.moves(),
            Of::Velocity => joint.moves() && !self.log.is_qd_derived,
        }
    }

    /// Whether no joint is driven.
    fn is_passive(&self) -> bool {
        self.audit.driven_by == Quantity::Torque && self.audit.joints.iter().all(is_passive)
    }
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
    match spikes as f64 / rows as f64 {
        share if share > MANY_SPIKES => Serious,
        share if share > SOME_SPIKES => Warning,
        _ => Info,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{audit, each, edited, one_joint, swing, uniform};
    use super::*;
    use crate::data::Columns;

    type Change = fn(&mut Log);

    /// Changes of a good log, and the findings that they bring: severity, and parts of text and remedy.
    const CASES: [(Change, &str); 24] = [
        (ramp, "Warning: q1 never reverses"),
        (ramp, "Warning: only 1.398 ... s of motion"),
        (still, "Serious: joint 1 moves by 0 rad"),
        (
            pause,
            "Warning: 1 gap(s), the longest of 0.202 s at t = 4.998 s ... rig.csv@4.998-",
        ),
        (drop_fifty, "Warning: 50 row(s) are missing ... 1.01 %"),
        (
            |log| log.notes.push("columns ignored".into()),
            "Info: columns ignored",
        ),
        (
            jump,
            "Warning: q1 jumps in 1 single row(s) ... up to 50 rad ... rig.csv@2.999-3.017",
        ),
        (
            freeze,
            "Warning: q1 stays the same ... for up to 0.4 s, 1 time(s) ... rig.csv@2-2.4",
        ),
        (
            |log| qd(log, |k, v| v + f64::from(k % 500 == 250) * 9.0),
            "Warning: qd1 has 10 sample(s) ... up to 9",
        ),
        (
            |log| qd(log, |_, v| 2.0 * v),
            "Serious: qd1 is 2 times dq1/dt ... [columns] qd = []",
        ),
        (
            |log| qd(log, |k, v| if k % 700 > 350 { v } else { -v }),
            "Serious: qd1 does not follow dq1/dt ... qd = []",
        ),
        (
            |log| qd(log, |_, _| 0.0),
            "Serious: qd1 is 0 rad/s throughout ... qd = []",
        ),
        (
            |log| qd(log, |_, v| v.to_degrees()),
            "Serious: ... qd1 looks like deg/s ... qd = [{ column = \"qd1\", unit = \"deg/s\" }]",
        ),
        (
            |log| qd(log, |_, v| -v),
            "Serious: qd1 follows -dq1/dt ... qd = [{ column = \"qd1\", factor = -1 }]",
        ),
        (reverse, "Serious: ... tau1 has the opposite sign"),
        (
            chatter,
            "Serious: tau1 chatters: 3 ... above 10.6 Hz ... 2 % of the rows ... smooth command",
        ),
        (
            chatter,
            "Warning: the motion explains ... of tau1 as logged ... fit trajectories",
        ),
        (
            push,
            "Warning: the motion explains ... something else moves the joint",
        ),
        // A second motion, as gravity would explain a single one.
        (
            |log| log.tau[0].rotate_left(5),
            "Warning: the acceleration of joint 1 trails tau1 by ... shift the column",
        ),
        (
            |log| tau(log, |_, _| 0.0),
            "Info: ... passive rig ... ratios to the inertia",
        ),
        (
            |log| tau(log, |_, _| 0.3),
            "Warning: tau1 is 0.3 N m throughout",
        ),
        (
            |log| tau(log, |_, nm| nm.abs()),
            "Warning: tau1 never changes sign",
        ),
        (
            |log| tau(log, |_, nm| nm.clamp(-9.0, 9.0)),
            "Warning: tau1 sits at an end of its range (-9 to 9 N m)",
        ),
        (constant_command, "Warning: cmd1 is 0.3 throughout"),
    ];

    fn qd(log: &mut Log, value: impl Fn(usize, f64) -> f64) {
        each(&mut log.qd[0], value);
    }

    fn tau(log: &mut Log, value: impl Fn(usize, f64) -> f64) {
        each(&mut log.tau[0], value);
    }

    fn ramp(log: &mut Log) {
        let time = uniform(700, 0.002);
        *log = one_joint(time.clone(), time.clone(), vec![1.0; 700], time);
    }

    fn still(log: &mut Log) {
        let time = uniform(700, 0.002);
        *log = one_joint(time.clone(), vec![0.5; 700], vec![0.0; 700], time);
    }

    fn pause(log: &mut Log) {
        each(&mut log.time[2500..], |_, t| t + 0.2);
    }

    fn drop_fifty(log: &mut Log) {
        let kept = |k: usize| (100 * k).saturating_sub(49)..(100 * k + 50).min(5000);
        *log = log.at(&(0..=50).map(kept).collect::<Vec<_>>());
    }

    fn jump(log: &mut Log) {
        log.q[0][1500] += 50.0;
    }

    fn freeze(log: &mut Log) {
        let held = log.q[0][1000];
        log.q[0][1000..1200].fill(held);
    }

    fn rest(log: &mut Log) {
        let held = log.q[0][1000];
        log.q[0][1000..].fill(held);
        log.qd[0][1000..].fill(0.0);
    }

    fn reverse(log: &mut Log) {
        tau(log, |_, nm| -nm);
    }

    fn clip(log: &mut Log) {
        log.tau[0][1000..1600].fill(40.0);
    }

    fn chatter(log: &mut Log) {
        let fast = |k: usize| if k.is_multiple_of(2) { 30.0 } else { -30.0 };
        let rare = |k: usize| if k.is_multiple_of(50) { 100.0 } else { 0.0 };
        tau(log, |k, nm| nm + fast(k) + rare(k));
    }

    fn push(log: &mut Log) {
        let push = |k: usize| 40.0 * (11.0 * 0.002 * k as f64).sin();
        tau(log, |k, nm| if k > 1000 { nm + push(k) } else { nm });
    }

    fn constant_command(log: &mut Log) {
        log.driven_by = Quantity::Command;
        log.tau[0].fill(0.3);
    }

    /// Whether a finding begins with a severity and has all parts of a text.
    fn fits(finding: &Finding, words: &str) -> bool {
        let remedy = finding.remedy.as_ref().map(ToString::to_string);
        let (severity, text) = (finding.severity, &finding.text);
        let whole = format!("{severity:?}: {text} {}", remedy.unwrap_or_default());
        words.split(" ... ").all(|part| whole.contains(part))
    }

    fn says(change: Change, words: &str) -> bool {
        let findings = audit(&edited(change)).findings;
        findings.iter().any(|finding| fits(finding, words))
    }

    /// The intervals of the finding that says this.
    fn spans(log: &Log, words: &str) -> Vec<[f64; 2]> {
        let mut findings = audit(log).findings.into_iter();
        let said = findings.find(|finding| fits(finding, words));
        said.expect(words).spans_s
    }

    #[test]
    fn a_fault_is_found_with_its_size_and_its_remedy() {
        for (change, words) in CASES {
            assert!(says(change, words), "{words}");
        }
    }

    #[test]
    fn what_is_no_fault_is_not_reported() {
        let good = audit(&swing()).findings;
        assert!(
            good.iter().all(|finding| finding.severity == Info),
            "{good:?}"
        );
        let rest_then_move: Change = |log| {
            let start = log.q[0][0];
            log.q[0].rotate_right(1000);
            log.q[0][..1000].fill(start);
        };
        assert!(!says(rest_then_move, "q1 stays the same"));
        let reversed_command: Change = |log| {
            reverse(log);
            log.driven_by = Quantity::Command;
        };
        assert!(!says(reversed_command, "opposite sign"));
        assert!(!says(jump, "Serious"), "a jump spoils no other finding");
    }

    #[test]
    fn a_velocity_beside_its_angle_is_said_in_steps() {
        let backward: Change = |log| log.qd[0] = differences(log, 1);
        assert!(says(
            backward,
            "Info: qd1 trails dq1/dt by ... ms, half a step, as a backward difference of q1 does; do not"
        ));
        let forward: Change = |log| log.qd[0] = differences(log, 0);
        assert!(says(
            forward,
            "Info: qd1 leads dq1/dt by ... ms, half a step, as a forward difference of q1 does; do not"
        ));
        let filtered: Change = |log| log.qd[0].rotate_right(4);
        assert!(says(
            filtered,
            "Warning: qd1 trails dq1/dt by ... steps: a filter, or another clock; do not"
        ));
        let ahead: Change = |log| log.qd[0].rotate_left(4);
        assert!(says(
            ahead,
            "Warning: qd1 leads dq1/dt by ... steps: a filter, or another clock; do not"
        ));
        let derived: Change = |log| {
            log.qd[0].rotate_right(4);
            log.is_qd_derived = true;
        };
        assert!(!says(derived, "qd1 trails"), "no column holds it");
    }

    /// Differences of the angle to the row before (1) or to the next one (0), rad/s.
    fn differences(log: &Log, before: usize) -> Vec<f64> {
        let q = &log.q[0];
        let ends = |row: usize| {
            [
                row.saturating_sub(before),
                (row + 1 - before).min(q.len() - 1),
            ]
        };
        let slope = |row: usize| {
            let [from, to] = ends(row);
            (q[to] - q[from]) / 0.002
        };
        (0..q.len()).map(slope).collect()
    }

    #[test]
    fn a_joint_that_slides_has_its_own_units() {
        let slide = Columns {
            slides: vec![true],
            ..Columns::default()
        };
        let log = edited(|log| {
            clip(log);
            jump(log);
            log.qd[0].fill(0.0);
        });
        let sliding = super::super::audit(&log, &slide).to_string();
        for unit in ["50 m,", "N) in", "0 m/s throughout", "fast m/s"] {
            assert!(sliding.contains(unit), "{unit} in {sliding}");
        }
        assert!(
            !sliding.contains("rad") && !sliding.contains("N m"),
            "{sliding}"
        );
        let turning = audit(&log).to_string();
        assert!(
            turning.contains("50 rad,") && turning.contains("N m) in"),
            "{turning}"
        );
    }

    #[test]
    fn what_belongs_to_a_part_of_a_log_says_from_when_to_when() {
        let drop: Change = |log| *log = log.at(&[0..2000, 2001..5000]);
        let cases: [(Change, &str, [usize; 2], f64); 6] = [
            (clip, "tau1 sits at an end", [1000, 1600], 0.05),
            (rest, "at rest in", [1000, 4999], 0.05),
            (drop, "1 row(s) are missing", [1999, 2001], 0.0),
            (
                |log| log.tau[0][700] += 500.0,
                "tau1 has 1 single-row spike",
                [700, 701],
                0.0,
            ),
            (
                |log| log.qd[0][900] += 9.0,
                "qd1 has 1 sample(s)",
                [900, 901],
                0.0,
            ),
            (freeze, "q1 stays the same", [1000, 1200], 0.0),
        ];
        let time = swing().time;
        for (change, words, rows, within_s) in cases {
            let is_off = |at: f64, row: usize| (at - time[row]).abs() > within_s;
            let mut spans = spans(&edited(change), words).into_iter();
            assert!(
                spans.any(|[from, to]| !is_off(from, rows[0]) && !is_off(to, rows[1])),
                "{words}"
            );
        }
        let message = audit(&edited(clip)).to_string();
        assert!(message.contains("\n         t = 2 to 3.2 s"), "{message}");
    }

    #[test]
    fn a_logger_that_repeats_its_source_is_placed() {
        let log = edited(|log| {
            let exact = log.q[0].clone();
            each(&mut log.q[0][..3000], |row, _| exact[row - row % 2]);
        });
        let spans = spans(&log, "q1 repeats the previous row");
        // Except where the joint reverses.
        let length_s: f64 = spans.iter().map(|[start, end]| end - start).sum();
        assert!(
            length_s > 0.7 * 6.0 && spans.iter().all(|span| span[1] < 6.05),
            "{spans:?}"
        );
    }
}
