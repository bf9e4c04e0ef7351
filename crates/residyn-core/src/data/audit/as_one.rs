//! Joints that move as one: what one of them does, the other does in proportion, so that no log tells which of them a
//! force belongs to that depends on the motion of both.

use super::quality::{Audit, Finding, Severity};
use crate::data::{Joint, Log};

/// Joints move as one if their positions correlate by more than this: less than 4 % of the square of one motion is then
/// its own, not much more than the friction and the elasticity of a drive add to any motion.
const AS_ONE: f64 = 0.98;

/// Whether two joints move as one in all of these logs together.
pub fn moves_as_one<'l>(logs: impl IntoIterator<Item = &'l Log>, a: Joint, b: Joint) -> bool {
    correlation(logs, a, b).abs() > AS_ONE
}

/// Correlation of two joints' positions about their means in each log; 0 if one of them rests.
fn correlation<'l>(logs: impl IntoIterator<Item = &'l Log>, a: Joint, b: Joint) -> f64 {
    let mut sums = [0.0; 3];
    for log in logs {
        let [a, b] = [a, b].map(|joint| about_mean(&log.q[joint]));
        for (a, b) in a.zip(b) {
            sums[0] += a * a;
            sums[1] += a * b;
            sums[2] += b * b;
        }
    }
    let [aa, ab, bb] = sums;
    let found = ab / (aa * bb).sqrt();
    if found.is_finite() { found } else { 0.0 }
}

fn about_mean(values: &[f64]) -> impl Iterator<Item = f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(move |value| value - mean)
}

/// Report in the first log's audit which joints move as one.
pub(super) fn report_as_one(logs: &[&Log], audits: &mut [Audit]) {
    let Some(first) = logs.first() else { return };
    for group in groups(logs, Joint::all(first.q.len()).collect()) {
        let names: Vec<String> = group.iter().map(ToString::to_string).collect();
        let text = format!(
            "joints {} move as one, their positions correlate by more than {AS_ONE} in all logs: what friction and inertia \
             two of them share is not looked for, and inertias of one limb trade; record each of them moving alone, \
             or with phases of their own",
            names.join(", ")
        );
        audits[0].add(Finding::new(Severity::Warning, text));
    }
}

/// Groups of at least two joints in which each moves as one with the first.
fn groups(logs: &[&Log], mut joints: Vec<Joint>) -> Vec<Vec<Joint>> {
    let mut groups = Vec::new();
    while !joints.is_empty() {
        let first = joints[0];
        let (group, rest) = joints.into_iter().partition(|joint| {
            *joint == first || moves_as_one(logs.iter().copied(), first, *joint)
        });
        groups.push(group);
        joints = rest;
    }
    groups.retain(|group: &Vec<Joint>| group.len() > 1);
    groups
}

#[cfg(test)]
mod tests {
    use super::super::audit_together;
    use super::super::tests::two_sines;
    use super::moves_as_one;
    use crate::data::{Columns, Joint, Log};

    fn with_second(name: &str, second: impl Fn(f64) -> f64) -> Log {
        let mut log = two_sines(name, 600, [1.0, 0.5], 2.0);
        log.q[1] = log.time.iter().map(|t| second(*t)).collect();
        log
    }

    #[test]
    fn joints_in_phase_move_as_one_until_a_log_moves_one_of_them_alone() {
        let joints = || Joint::all(2).collect::<Vec<_>>();
        let as_one = |logs: &[Log]| moves_as_one(logs, joints()[0], joints()[1]);
        let told = |logs: &[Log]| {
            let audits = audit_together(logs, &Columns::default());
            let mut findings = audits.iter().flat_map(|audit| &audit.findings);
            findings.any(|finding| finding.text.starts_with("joints 1, 2 move as one"))
        };
        let opposite = with_second("opposite.csv", |t| 1.0 - 0.5 * (2.0 * t).sin());
        let own = with_second("own.csv", |t| 0.5 * (3.0 * t).sin());
        let still = with_second("still.csv", |_| 0.3);
        for (logs, expected) in [
            (vec![opposite.clone()], true),
            (vec![opposite.clone(), own], false),
            (vec![still.clone()], false),
            (vec![opposite, still], false),
        ] {
            assert_eq!(as_one(&logs), expected);
            assert_eq!(told(&logs), expected);
        }
    }
}
