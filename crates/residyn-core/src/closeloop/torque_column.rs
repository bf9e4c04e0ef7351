//! What the torques of the logs are, if the model file does not say.

use rayon::prelude::*;

use super::error_model::ErrorModel;
use super::prepare::{Prepared, ReadyLogs};
use super::problem::Problem;
use super::select::{forces_and_rotors, usual_forces};
use crate::data::statistics::mean;
use crate::data::torque_column::share_of_held;
use crate::data::{Finding, Log, Quantity, Severity, TorqueColumn};
use crate::model::FittedEffect;

/// The torques of all logs are of one kind, and this many logs suffice to show which.
const FEW: usize = 3;

impl Prepared<'_> {
    /// The same with the torques of all logs taken as what they are: as the model file or the logs say or, by its fit to
    /// the training logs, as the kind that explains clearly more than held torques do.
    pub(super) fn with_known_torques(mut self) -> Self {
        let is_held = |log: &Log| log.torque == TorqueColumn::Held;
        let is_known = self.model.columns.torque.is_some() || !self.train.logs.iter().all(is_held);
        // What cannot be fitted is refused as soon as it would be.
        if is_known || self.model.driven_by() != Quantity::Torque || self.check().is_err() {
            return self;
        }
        let column = self.problem(ErrorModel::OutputError).torque_column();
        if column == TorqueColumn::Held {
            return self;
        }
        self.model.to_mut().columns.torque = Some(column);
        for ready in [&mut self.train, &mut self.test] {
            ready.take_torques_as(column);
        }
        if let Some(audit) = self.train.audits.first_mut() {
            audit.add(Finding::new(Severity::Warning, said(column)));
        }
        self
    }
}

fn said(column: TorqueColumn) -> String {
    let what = match column {
        TorqueColumn::Held => "held from their rows to the next",
        TorqueColumn::Sampled => "readings at the times of their rows, not held from them on",
        TorqueColumn::Mean => "means since the rows before, not held from their rows on",
    };
    format!(
        "the torques of all logs are taken as {what}: the motion says so. `[log] torque = \"{}\"` in the model file \
         confirms it, \"held\" overrules it",
        column.key()
    )
}

impl ReadyLogs {
    fn take_torques_as(&mut self, column: TorqueColumn) {
        for logs in [&mut self.logs, &mut self.for_fits] {
            *logs = read_as(logs, column);
        }
    }
}

fn read_as<C: FromIterator<Log>>(logs: &[Log], column: TorqueColumn) -> C {
    let logs = logs.iter().cloned();
    logs.map(|log| log.with_torques(column)).collect()
}

impl Problem<'_> {
    /// What the torques are, if the declared model says the same with the usual forces and with rotors as well: of a rotor that
    /// the file lacks the joint seems to respond at another time.
    fn torque_column(&self) -> TorqueColumn {
        let found = self.torque_column_beside(&usual_forces(self));
        let is_held = found == TorqueColumn::Held;
        let is_sure = |found| self.torque_column_beside(&forces_and_rotors(self)) == found;
        match is_held || is_sure(found) {
            true => found,
            false => TorqueColumn::Held,
        }
    }

    /// What the torques are, by what the declared model with these effects leaves unexplained of the motion or of the torques,
    /// whichever shows it more clearly.
    fn torque_column_beside(&self, effects: &[FittedEffect]) -> TorqueColumn {
        let logs = &self.logs[..FEW.min(self.logs.len())];
        let with = |column| read_as::<Vec<Log>>(logs, column);
        let all = TorqueColumn::ALL.map(|column| (column, with(column)));
        let left = |measure: &(dyn Fn(&Problem<'_>) -> Option<f64> + Sync)| {
            let of = |(_, logs): &(TorqueColumn, Vec<Log>)| measure(&self.on(logs));
            all.par_iter().map(of).collect::<Vec<_>>()
        };
        let by_motion = match self.declared.joints > self.settings.fit.most_joints_by_motion {
            true => Vec::new(),
            false => left(&|problem| problem.motion_noise(effects)),
        };
        let by_torques = left(&|problem| problem.torque_noise(effects));
        let share = |left: &Vec<Option<f64>>| share_of_held(left).map_or(1.0, |(share, _)| share);
        let clearer = match share(&by_motion) < share(&by_torques) {
            true => by_motion,
            false => by_torques,
        };
        TorqueColumn::clearest(&clearer, self.settings.fit.other_torque_share)
    }

    /// What the declared model with these effects leaves of the motion; `None` if it diverges.
    fn motion_noise(&self, effects: &[FittedEffect]) -> Option<f64> {
        let fitted = self.fitted_beside(&self.started_from(), effects);
        Some(fitted.ok()?.fit.scale)
    }

    /// What the same model leaves of the torques: the geometric mean over the joints. `None` if
    /// it gives accelerations, or diverges.
    fn torque_noise(&self, effects: &[FittedEffect]) -> Option<f64> {
        let logarithms = self.torques_left(effects)?.into_iter().map(f64::ln);
        Some(mean(&logarithms.collect::<Vec<f64>>()).exp())
    }
}
