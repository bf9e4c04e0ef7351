//! Stage 4, at its start: what the torques show that the law of drives on position control asks for.
//!
//! Fits to the motion of a closed loop take hundreds of times longer than fits to these torques, so that a search by motion
//! begins where one by torques has ended.

use rand::Rng;

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
    /// torques, or if either fit fails.
    pub(super) fn by_torques_first(
        &self,
        apart: &[Log],
        rng: &mut impl Rng,
        watch: &dyn Watch,
    ) -> Option<Fitted> {
        if !self.begins_with_torques() {
            return None;
        }
        let declared = self.in_torques().fit_declared().ok()?;
        let found = command_path::searched(declared, apart, rng, watch).ok()?;
        let start_states = self.shooting.initial_start_states(0);
        (self.refit(&found.chosen.after.model, start_states, None)).ok()
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
