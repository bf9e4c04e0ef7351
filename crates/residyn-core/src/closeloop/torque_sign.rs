//! Whether the logged torques or commands have the opposite sign to the model's.

use super::fitted::Fitted;
use super::problem::Problem;
use crate::data::{Audit, Log, Remedy, reversed_driving};

impl Problem<'_> {
    /// Report in the audits of the problem's logs that their torques, or commands, look reversed on all joints at once.
    /// The audit of a log alone finds this on single joints whose acceleration follows them closely; here the model
    /// shows it.
    pub(super) fn report_reversed(&self, usual: Option<&Fitted>, audits: &mut [Audit]) {
        let key = self.declared.driven_by().key();
        let is_mended = audits.iter().any(|audit| mends(audit, key));
        if !self.moves() || is_mended || follow_torques(self.audits()) {
            return;
        }
        let reversed: Vec<Log> = self.logs.iter().map(reversed).collect();
        let other = self.on(&reversed).with_usual_friction();
        let (Some(usual), Some(other)) = (usual, other) else {
            return;
        };
        let share = other.loss() / usual.loss().max(f64::MIN_POSITIVE);
        if share < self.settings.notes.reversed_loss {
            let model = self.declared;
            let finding = reversed_driving(
                share.sqrt(),
                &model.columns,
                model.driven_by(),
                model.joints,
            );
            audits
                .iter_mut()
                .for_each(|audit| audit.add(finding.clone()));
        }
    }
}

/// Whether accelerations follow the torques as logged rather than their opposite, over all joints and logs. A fit that
/// has failed, as fits of joints that mostly rest do, may leave a larger error than any with other signs; what the logs
/// show by themselves is not overruled by it.
fn follow_torques(audits: &[Audit]) -> bool {
    let joints = audits.iter().flat_map(|audit| &audit.joints);
    let to_torque = joints.filter_map(|joint| joint.response?.to_torque);
    to_torque.sum::<f64>() > 0.0
}

/// Whether an audit already proposes another remedy for the columns that drive the joints.
fn mends(audit: &Audit, key: &str) -> bool {
    let mut lines = audit.serious().filter_map(|finding| match &finding.remedy {
        Some(Remedy::Columns(lines)) => Some(lines),
        _ => None,
    });
    lines.any(|lines| lines.iter().any(|line| line.starts_with(key)))
}

fn reversed(log: &Log) -> Log {
    let mut log = log.clone();
    for value in log.tau.iter_mut().flatten() {
        *value = -*value;
    }
    log
}
