//! What a model is compared with the logs by.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::data::Log;
use crate::identify::{Shooting, Window};
use crate::model::{Dynamics, Effect, Entry, Model};

/// The errors that fits lower, that effects are selected by and that the report compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// Of the positions that the logged torques lead to, integrated open loop.
    Motion,
    /// Of the torques that the logged motion needs.
    Torque,
}

impl Space {
    /// Whether an effect can be told by these errors. In a motion, in which each joint moves the others, a motor between two of them
    /// is too much like the links' own inertia. The torques are those of the motion as it was read, and it takes commands
    /// that can be told from the torque that acts: one that explains any command would always fit.
    pub(super) fn shows(self, effect: &Effect) -> bool {
        match self {
            Self::Motion => !effect.is_coupling(),
            Self::Torque => !matches!(effect.entry, Entry::Reading(_)) && effect.tells_command(),
        }
    }

    /// In how many parts a model of so many joints is judged: in a motion each joint moves the others, torques are off joint by
    /// joint.
    pub(super) fn parts(self, joints: usize) -> usize {
        match self {
            Self::Motion => 1,
            Self::Torque => joints,
        }
    }

    /// A model compiled for these errors.
    ///
    /// # Panics
    /// On the torques of a model that gives accelerations: closing the loop refuses those.
    pub(super) fn compile(self, model: &Model) -> Dynamics {
        match self {
            Self::Motion => model.dynamics(),
            Self::Torque => (model.smoothed_torque_balance()).expect("the model has torques"),
        }
    }

    /// These windows of logs, whose joints have this noise, in rad (or m) or in N m (or N), and friction that reverses over
    /// these speeds.
    pub(super) fn shooting<'l>(
        self,
        logs: &'l [Log],
        windows: Vec<Window>,
        noise: &[f64],
        sign_widths: &[f64],
    ) -> Shooting<'l> {
        match self {
            Self::Motion => Shooting::new(logs, windows, noise),
            Self::Torque => Shooting::of_torques(logs, windows, noise, sign_widths),
        }
    }
}
