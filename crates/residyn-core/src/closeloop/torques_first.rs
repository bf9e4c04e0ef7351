//! Stage 4, at its start: what the torques show that the law of drives on position control asks for.
//!
//! Fits to the motion of a closed loop take hundreds of times longer than fits to these torques, so that a search by motion
//! begins where one by torques has ended.

use rand::Rng;

use super::by_motion::estimate;
use super::command_path;
use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::problem::Problem;
use super::stage::Watch;
use crate::data::{Log, Quantity};

impl<'a> Problem<'a> {
    /// Whether motion under commands is compared, by a model that has torques.
    pub(super) fn begins_with_torques(&self) -> bool {
        self.error_model == ErrorModel::OutputError
            && self.declared.driven_by() == Quantity::Command
            && self.declared.torque_balance().is_some()
    }

    /// The model that a search by torques ends with, fitted to the motion; `None` if the problem does not begin with
    /// torques, if either fit fails, or if the `declared` model fits the motion better: torques between rows that are too
    /// far apart, under a law whose gains are unknown too, are least where every parameter is zero.
    pub(super) fn by_torques_first(
        &self,
        declared: &Fitted,
        apart: &[Log],
        rng: &mut impl Rng,
        watch: &dyn Watch,
    ) -> Option<Fitted> {
        if !self.begins_with_torques() {
            return None;
        }
        let in_torques = self.in_torques().fit_declared().ok()?;
        let found = command_path::searched(in_torques, apart, rng, watch).ok()?;
        let first = estimate(self, &found.chosen.after.model).ok()?;
        (first.loss() < declared.loss()).then_some(first)
    }

    /// The same logs and model, with torques compared.
    fn in_torques(&self) -> Problem<'a> {
        let logs = (self.logs, self.audits().to_vec());
        Problem {
            solver: self.solver,
            ..Problem::audited(
                self.declared,
                self.library,
                ErrorModel::InverseDynamics,
                logs,
                self.settings,
            )
        }
    }
}
