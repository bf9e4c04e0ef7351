use serde::{Deserialize, Serialize};

use super::TrainError;

/// How the size of the residual F_r is weighed against the prediction error E. Without it, F = F_p + F_r is not unique:
/// the network could replace what the physics can express.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Penalty {
    /// Minimise E + alpha ||F_r||.
    Fixed { alpha: f64 },
    /// Minimise ||F_r|| subject to E = 0 by ascent on the dual variable lambda: minimise
    /// ||F_r|| + lambda E, and after each epoch lambda <- lambda + rate E, where E is the epoch's mean
    /// error. Algorithm 1 of Yin et al. 2021, "Augmenting physical models with deep networks for complex dynamics
    /// forecasting", arXiv:2010.04456, with one epoch as its outer iteration. The epoch's E is measured while it runs,
    /// not in a second pass.
    Adaptive { initial: f64, rate: f64 },
}

impl Default for Penalty {
    fn default() -> Self {
        Self::Fixed { alpha: 1e-4 }
    }
}

impl Penalty {
    /// alpha or the initial lambda, which [`Penalty::next`] updates.
    pub fn initial(self) -> f64 {
        match self {
            Self::Fixed { alpha } => alpha,
            Self::Adaptive { initial, .. } => initial,
        }
    }

    /// The same penalty with another alpha or initial lambda.
    pub(super) fn from(self, weight: f64) -> Self {
        match self {
            Self::Fixed { .. } => Self::Fixed { alpha: weight },
            Self::Adaptive { rate, .. } => Self::Adaptive {
                initial: weight,
                rate,
            },
        }
    }

    /// The weight for the next epoch.
    pub fn next(self, weight: f64, epoch_error: f64) -> f64 {
        match self {
            Self::Fixed { alpha } => alpha,
            Self::Adaptive { rate, .. } => weight + rate * epoch_error,
        }
    }

    /// The weights of E and ||F_r|| in the minimised sum. Without a residual, the sum is E alone.
    pub(super) fn weights(self, weight: f64, has_residual: bool) -> [f64; 2] {
        match self {
            _ if !has_residual => [1.0, 0.0],
            Self::Fixed { .. } => [1.0, weight],
            Self::Adaptive { .. } => [weight, 1.0],
        }
    }

    pub(super) fn check(self) -> Result<(), TrainError> {
        match self {
            Self::Fixed { alpha } => not_negative(&[("alpha", alpha)]),
            Self::Adaptive { initial, rate } => {
                not_negative(&[("initial", initial), ("rate", rate)])
            }
        }
    }
}

/// Refuses settings that are negative or not finite.
pub(super) fn not_negative(settings: &[(&'static str, f64)]) -> Result<(), TrainError> {
    let wrong = |(_, value): &&(&str, f64)| !(value.is_finite() && *value >= 0.0);
    match settings.iter().find(wrong) {
        Some(&(name, value)) => Err(TrainError::Setting { name, value }),
        None => Ok(()),
    }
}
