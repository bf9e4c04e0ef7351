use serde::{Deserialize, Serialize};

use super::{HybridModel, Training};

/// A model of a sweep after its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Stored")]
pub struct Trained {
    /// Prediction error on the training segments.
    pub error: f64,
    /// ||F_r||; 0 in a model without a residual.
    pub residual_norm: f64,
    /// Values of the physical parameters, in their order and units.
    pub parameters: Vec<f64>,
    /// The loss became infinite or NaN. All other values are then from the step before or not finite.
    pub diverged: bool,
}

/// A model as stored in JSON, where numbers that are not finite are null.
#[derive(Deserialize)]
struct Stored {
    error: Option<f64>,
    residual_norm: Option<f64>,
    parameters: Vec<Option<f64>>,
    diverged: bool,
}

impl From<Stored> for Trained {
    fn from(stored: Stored) -> Self {
        let number = |stored: Option<f64>| stored.unwrap_or(f64::NAN);
        Self {
            error: number(stored.error),
            residual_norm: number(stored.residual_norm),
            parameters: stored.parameters.into_iter().map(number).collect(),
            diverged: stored.diverged,
        }
    }
}

impl Trained {
    /// The end of a run that did not diverge.
    pub(super) fn of(run: &Training) -> Self {
        let last = run.history().last().expect("a run records its end");
        Self {
            error: last.error,
            residual_norm: last.residual_norm,
            parameters: last.parameters.clone(),
            diverged: false,
        }
    }

    /// The end of a run that diverged in `model`.
    pub(super) fn diverged(model: &HybridModel) -> Self {
        Self {
            error: f64::NAN,
            residual_norm: f64::NAN,
            parameters: model.weights().parameters,
            diverged: true,
        }
    }
}
