//! The error model: the errors by which a model is compared with the logs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::problem::Problem;
use crate::data::{Log, Quantity};
use crate::identify::{Shooting, Window};
use crate::model::{Dynamics, Effect, Entry, Model, ShowsIn};

/// The errors that fits minimise, effects are selected by and the report compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorModel {
    /// Errors of the positions that the logged torques lead to, integrated open loop.
    OutputError,
    /// Errors of the torques that the logged motion needs.
    InverseDynamics,
}

impl Problem<'_> {
    /// Whether its errors can show an effect.
    pub(super) fn shows(&self, effect: &Effect) -> bool {
        self.error_model.shows(effect, self.declared)
    }
}

impl ErrorModel {
    /// Whether these errors can show an effect. Torques are computed from the motion as it was read, and the torque
    /// that acts must determine the command: an effect that explains any command would always fit. A limit explains large
    /// ones only, if it is known what the law asks for. The swing of a motor against its link is faster than torques are
    /// compared.
    fn shows(self, effect: &Effect, declared: &Model) -> bool {
        let by_law = declared.driven_by() == Quantity::Command;
        match self {
            Self::OutputError => match effect.shows_in {
                ShowsIn::Any => true,
                ShowsIn::Law => by_law,
                ShowsIn::Torques | ShowsIn::LawTorques => false,
            },
            Self::InverseDynamics => {
                !matches!(effect.entry, Entry::Reading(_))
                    && !effect.is_transmission()
                    && (effect.distinguishes_command()
                        || declared.knows_law() && effect.limits_command())
                    && (by_law || matches!(effect.shows_in, ShowsIn::Any | ShowsIn::Torques))
            }
        }
    }

    /// In how many parts a model with `joints` joints is judged: in a motion each joint moves the others, whereas
    /// torque errors are separate for each joint.
    pub(super) fn parts(self, joints: usize) -> usize {
        match self {
            Self::OutputError => 1,
            Self::InverseDynamics => joints,
        }
    }

    /// A model compiled for these errors.
    ///
    /// # Panics
    /// For the torques of a model that gives accelerations: closing the loop rejects such models.
    pub(super) fn compile(self, model: &Model) -> Dynamics {
        match self {
            Self::OutputError => model.dynamics(),
            Self::InverseDynamics => {
                (model.smoothed_torque_balance()).expect("the model has torques")
            }
        }
    }

    /// These windows of logs, whose joints have this noise, in rad (or m) or in N m (or N), and these smoothing
    /// velocities.
    pub(super) fn shooting<'l>(
        self,
        logs: &'l [Log],
        windows: Vec<Window>,
        noise: &[f64],
        smoothing_velocities: &[f64],
    ) -> Shooting<'l> {
        match self {
            Self::OutputError => Shooting::new(logs, windows, noise),
            Self::InverseDynamics => {
                Shooting::of_torques(logs, windows, noise, smoothing_velocities)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::ErrorModel;
    use crate::model::{Effect, Library};

    #[test]
    fn a_hot_winding_shows_where_a_law_turns_commands_into_torques() {
        let library = Library::built_in();
        let heat = library.effect("winding_heat").unwrap();
        for compared in [ErrorModel::OutputError, ErrorModel::InverseDynamics] {
            let shows = |system: &str| compared.shows(heat, &library.model(system).unwrap());
            assert!(shows("servo") && !shows("pendulum"), "{compared:?}");
        }
    }

    #[test]
    fn torques_do_not_show_a_force_that_follows_them() {
        let file = |rate: &str| {
            let text = format!(
                "[effect]\nname = \"own\"\nabout = \"\"\nforce = \"c * w\"\n\n[states]\n\
                 w = {{ rate = \"{rate}\", unit = \"1\" }}\n\n[parameters]\nc = {{ unit = \"1\", typical = 1 }}\n"
            );
            Effect::from_text(Path::new("own.toml"), &text).unwrap()
        };
        let model = Library::built_in().model("acrobot").unwrap();
        for (rate, shows) in [("(tau - w) / 0.01", false), ("(qd - w) / 0.01", true)] {
            let found = ErrorModel::InverseDynamics.shows(&file(rate), &model);
            assert_eq!(found, shows, "{rate}");
        }
    }

    #[test]
    fn torques_show_a_limit_only_if_the_law_is_known() {
        let library = Library::built_in();
        let shows = |servo: &str, name: &str| {
            let model = library.model_from_text("servo.toml", servo).unwrap();
            ErrorModel::InverseDynamics.shows(library.effect(name).unwrap(), &model)
        };
        let free = Library::system_text("servo").unwrap();
        let known = free.replace("unit = \"N m/rad\"", "unit = \"N m/rad\", fixed = true");
        let known = known.replace("unit = \"N m s/rad\"", "unit = \"N m s/rad\", fixed = true");
        for limit in ["actuator_saturation", "torque_speed_limit"] {
            assert!(shows(&known, limit), "{limit}");
            assert!(!shows(free, limit), "{limit}");
        }
        assert!(!shows(&known, "actuator_deadzone") && shows(free, "actuator_gain"));
    }
}
