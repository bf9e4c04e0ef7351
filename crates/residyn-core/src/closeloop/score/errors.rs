use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bootstrap::{interval, reduction_interval};
use super::noise_floor::noise_floor;
use super::test_log::TestLog;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::request::Reference;
use crate::closeloop::settings::ScoreSettings;
use crate::data::{Log, Quantity};
use crate::identify::calibrate_first;
use crate::model::{Dynamics, Model};
use crate::sim::metric::{Assessment, TorqueError, assess, torque_error};

/// Open-loop errors on the test logs.
pub struct Errors {
    /// The declared model with the values in its file, before any fit.
    pub declared: Assessment,
    /// The declared model, fitted.
    pub before: Assessment,
    /// The declared model with Coulomb and viscous friction on every joint, fitted: what most would try first. `None`
    /// if it already has both, and if no effects are looked for.
    pub with_friction: Option<Assessment>,
    /// With the effects that were found, fitted.
    pub after: Assessment,
    /// The same with each test log's sensor zeros estimated on its beginning, scored on the rest; if the model has
    /// zeros per log, and the logs are long enough.
    pub zeroed: Option<Assessment>,
    /// The position error of all joints together at the middle horizon that the sensors' noise accounts for, in the rows
    /// and in the start states of windows, rad (or m). `None` if torques are compared.
    pub noise_floor: Option<f64>,
    /// With the residual network.
    pub hybrid: Option<Assessment>,
    /// Other models as they are, by name.
    pub against: Vec<(String, Assessment)>,
    /// Errors of the torques that the logged motion needs, if the model has torques.
    pub torque: Option<TorqueErrors>,
    /// Errors of the two fitted models on each test log; empty for a single log.
    pub by_log: Vec<TestLog>,
    /// 95 % interval of the relative reduction of the position error, before to after.
    pub reduction_ci95: Option<[f64; 2]>,
}

/// error of the torques that the logged motion needs, on the test logs
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "TorqueEntry")]
pub struct TorqueErrors {
    // Of the declared model with the values in its file.
    #[serde(rename = "as_declared")]
    pub declared: TorqueError,
    pub before: TorqueError,
    /// with Coulomb and viscous friction on every joint, fitted; null if the declared model has both
    pub with_friction: Option<TorqueError>,
    pub after: TorqueError,
    /// 95 % interval of the relative reduction of the error, before to after
    pub reduction_ci95: Option<[f64; 2]>,
}

impl Errors {
    /// How many times what the sensors' noise accounts for the error of the model with effects is.
    pub fn over_noise(&self) -> Option<f64> {
        Some(self.after.position_rms() / self.noise_floor?)
    }

    /// The errors of the fitted declared model and of the one with effects, in one number each.
    pub fn compared(&self, error_model: ErrorModel) -> [f64; 2] {
        match (error_model, &self.torque) {
            (ErrorModel::InverseDynamics, Some(torque)) => {
                [torque.before.relative, torque.after.relative]
            }
            _ => [self.before.position_rms(), self.after.position_rms()],
        }
    }
}

/// The models that are compared.
#[derive(Clone, Copy)]
pub(in crate::closeloop) struct Scored<'m> {
    /// That they were fitted to.
    pub problem: &'m Problem<'m>,
    /// With the values in its file.
    pub declared: &'m Model,
    pub before: &'m Fitted,
    /// The declared model with the usual friction.
    pub with_friction: Option<&'m Fitted>,
    pub after: &'m Fitted,
    pub hybrid: Option<&'m Dynamics>,
    pub against: &'m [Reference],
}

/// Scores models on the test logs.
pub(in crate::closeloop) struct Scorer<'a> {
    pub test: &'a [Log],
    pub settings: &'a ScoreSettings,
}

impl Scorer<'_> {
    /// Score each model.
    pub fn errors(&self, models: Scored<'_>, rng: &mut impl Rng) -> Errors {
        let scored = |other: &Reference| (other.name.clone(), self.as_it_is(&other.model));
        // Logs of commands hold no torques: those that the drives ask for matter only if they were fitted.
        let is_fitted = models.problem.error_model == ErrorModel::InverseDynamics;
        let has_torques = is_fitted || models.declared.driven_by() == Quantity::Torque;
        let torque = has_torques.then(|| self.torques(models, rng)).flatten();
        let fitted = [models.before, models.after];
        let (before, after) = rayon::join(|| self.fitted(fitted[0]), || self.fitted(fitted[1]));
        Errors {
            declared: self.as_it_is(models.declared),
            with_friction: models.with_friction.map(|model| self.fitted(model)),
            hybrid: models.hybrid.map(|model| self.dynamics(model)),
            against: models.against.iter().map(scored).collect(),
            reduction_ci95: reduction_interval(before.middle(), after.middle(), self.settings, rng),
            zeroed: self.zeroed(models.after),
            noise_floor: noise_floor(
                models.problem,
                &models.after.model.dynamics(),
                self.test,
                self.settings.middle_s(),
            ),
            by_log: self.log_by_log(models.problem.error_model, fitted, [&before, &after]),
            torque,
            before,
            after,
        }
    }

    fn torques(&self, models: Scored<'_>, rng: &mut impl Rng) -> Option<TorqueErrors> {
        let error = |model: &Model| torque_error(model, self.test);
        let (before, after) = (error(&models.before.model)?, error(&models.after.model)?);
        let blocks = before.blocks.iter().copied();
        let blocks: Vec<(f64, f64)> = blocks.zip(after.blocks.iter().copied()).collect();
        Some(TorqueErrors {
            reduction_ci95: interval(&blocks, self.settings, rng),
            declared: error(models.declared)?,
            with_friction: models.with_friction.and_then(|model| error(&model.model)),
            before,
            after,
        })
    }

    /// The error of a fitted model, in one number.
    pub fn compared(&self, error_model: ErrorModel, fitted: &Fitted) -> f64 {
        match error_model {
            ErrorModel::OutputError => self.fitted(fitted).position_rms(),
            ErrorModel::InverseDynamics => {
                let error = torque_error(&fitted.model, self.test);
                error.map_or(f64::NAN, |error| error.relative)
            }
        }
    }

    fn zeroed(&self, after: &Fitted) -> Option<Assessment> {
        let differs = after
            .model
            .effects
            .iter()
            .any(|effect| effect.effect.parameters.iter().any(|p| p.per_log));
        let mut logs = self.test.to_vec();
        let seconds = self.settings.zeroed_on_s;
        let dynamics = after.model.dynamics();
        let zeroed = differs.then(|| calibrate_first(&dynamics, &mut logs, seconds).ok())??;
        let scored = assess(&zeroed.dynamics, &logs, &self.settings.horizons_s);
        let has_windows = scored.horizons.iter().all(|h| !h.windows.is_empty());
        has_windows.then_some(scored)
    }

    /// The error of a fitted model.
    pub fn fitted(&self, fitted: &Fitted) -> Assessment {
        self.dynamics(&fitted.model.dynamics())
    }

    fn as_it_is(&self, model: &Model) -> Assessment {
        self.dynamics(&model.dynamics())
    }

    fn dynamics(&self, model: &Dynamics) -> Assessment {
        assess(model, self.test, &self.settings.horizons_s)
    }
}
