//! Findings about the command of a joint's drive.

use super::super::JointAudit;
use super::super::table::short;
use super::Found;
use super::Severity::Warning;

impl Found {
    pub(super) fn about_command(&mut self, joint: &JointAudit) {
        let (command, name) = (&joint.tau, &joint.tau.name);
        if command.constant {
            let text = format!(
                "{name} is {} throughout: the drive's gains cannot be distinguished from the load; vary the command",
                short(command.max)
            );
            self.add_of(joint, Warning, text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::swing;
    use super::super::tests::says;
    use super::*;
    use crate::data::Quantity;

    #[test]
    fn a_command_is_not_taken_for_a_torque() {
        let mut log = swing();
        log.tau[0].iter_mut().for_each(|tau| *tau = -*tau);
        let opposite = ["opposite sign"];
        let serious = super::super::Serious;
        assert!(says(&log, serious, &opposite));
        log.driven_by = Quantity::Command;
        assert!(!says(&log, serious, &opposite));
        log.tau[0].fill(0.3);
        assert!(says(&log, Warning, &["cmd1 is 0.3 throughout"]));
    }
}
