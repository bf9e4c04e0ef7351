//! Joints at rest: nothing can be learned about a joint that rests in all logs that are used together.

use super::joint::VISIBLE_STEPS;
use super::quality::{Audit, Finding, Severity};
use super::table::short;
use crate::data::Joint;

/// Report for each log which joints do not move in it. That is serious if none of the other logs moves the joint.
pub(super) fn report_rest(audits: &mut [Audit]) {
    let joints = audits.iter().map(|audit| audit.joints.len()).max();
    for joint in Joint::all(joints.unwrap_or(0)) {
        let moves = |audit: &Audit| Some(audit.joints.get(joint.index())?.moves());
        let is_moved = audits.iter().any(|audit| moves(audit) == Some(true));
        let resting = audits
            .iter_mut()
            .filter(|audit| moves(audit) == Some(false));
        for audit in resting {
            let q = &audit.joints[joint].q;
            let text = format!("{} {}", short(q.range()), q.unit);
            audit.add(finding(joint, &text, is_moved));
        }
    }
}

fn finding(joint: Joint, range: &str, is_moved_by_others: bool) -> Finding {
    let (severity, therefore) = match is_moved_by_others {
        true => (Severity::Info, "its parameters come from the other logs"),
        false => (Severity::Serious, "its parameters cannot be identified"),
    };
    let text = format!(
        "joint {joint} moves by {range}, less than {VISIBLE_STEPS} resolution steps or standard deviations of the \
         noise: {therefore}"
    );
    Finding::new(severity, text).of(joint)
}

#[cfg(test)]
mod tests {
    use super::super::audit_together;
    use super::super::tests::two_sines;
    use crate::data::{Columns, Log, Severity};

    fn message(logs: &[Log]) -> Vec<Vec<Severity>> {
        let audits = audit_together(logs, &Columns::default());
        let of_log = |audit: super::Audit| {
            let findings = audit.findings.into_iter();
            let rest = findings.filter(|finding| finding.text.contains("joint 2 moves by"));
            rest.map(|finding| finding.severity).collect()
        };
        audits.into_iter().map(of_log).collect()
    }

    #[test]
    fn a_joint_that_rests_in_one_log_is_serious_where_no_other_moves_it() {
        let log = |name, second| two_sines(name, 600, [1.0, second], 2.0);
        let (moves, rests) = (log("moves.csv", 0.5), log("rests.csv", 0.0));
        assert_eq!(message(std::slice::from_ref(&rests)), [[Severity::Serious]]);
        assert_eq!(
            message(&[rests.clone(), rests.clone()]),
            [[Severity::Serious], [Severity::Serious]]
        );
        assert_eq!(message(&[moves, rests]), [vec![], vec![Severity::Info]]);
    }
}
