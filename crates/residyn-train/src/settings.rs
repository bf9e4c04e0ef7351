use std::num::NonZeroUsize;

use serde::{Deserialize, Serialize};

use super::penalty::not_negative;
use super::{HybridModel, OptimizerKind, Penalty, Schedule, TrainError};
use residyn_core::limits::EPOCHS;
use residyn_core::sim::Integrator;

/// The settings of a fit. Defaults are the published ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FitSettings {
    pub epochs: usize,
    pub optimizer: OptimizerKind,
    pub learning_rates: LearningRates,
    /// Share of the learning rates that remains in the last epoch. 1 keeps them constant.
    pub anneal: f64,
    /// How the learning rates fall to that share.
    pub schedule: Schedule,
    /// Decoupled weight decay (Loshchilov and Hutter 2019, arXiv:1711.05101): at each step the weights of the residual
    /// or, in a model without one, of the network shrink by this share of the learning rate. Weight decay keeps a
    /// network small in regions without data.
    pub weight_decay: f64,
    pub batching: Batching,
    pub penalty: Penalty,
    pub integrator: Integrator,
    /// Size of a unit error in each state (positions, then velocities); 1 if not given.
    pub error_scale: Option<Vec<f64>>,
    /// Epochs between two entries of the history, which also record the validation error.
    pub record_every: NonZeroUsize,
}

/// Learning rates of the parts. Zero freezes a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearningRates {
    /// Of the physical parameters, relative to each parameter's scale.
    pub physics: f64,
    /// Of a network that serves as the prior.
    pub prior: f64,
    /// Of the residual network.
    pub residual: f64,
}

/// How an epoch goes through the segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Batching {
    /// One step on all segments.
    #[default]
    Full,
    /// A step on each part of a newly shuffled order; the last part may be smaller.
    Mini { size: NonZeroUsize },
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            epochs: 4000,
            optimizer: OptimizerKind::default(),
            learning_rates: LearningRates::default(),
            anneal: 1.0,
            schedule: Schedule::default(),
            weight_decay: 0.0,
            batching: Batching::default(),
            penalty: Penalty::default(),
            integrator: Integrator::default(),
            error_scale: None,
            record_every: NonZeroUsize::new(100).expect("not zero"),
        }
    }
}

impl Default for LearningRates {
    fn default() -> Self {
        Self {
            physics: 0.01,
            prior: 0.01,
            residual: 0.01,
        }
    }
}

impl LearningRates {
    /// The learning rates of a model's prior and residual.
    pub(super) fn of(&self, model: &HybridModel) -> [f64; 2] {
        let prior = match &model.physics {
            Some(_) => self.physics,
            None => self.prior,
        };
        [prior, self.residual]
    }
}

impl FitSettings {
    pub(super) fn check(&self) -> Result<(), TrainError> {
        let LearningRates {
            physics,
            prior,
            residual,
        } = self.learning_rates;
        not_negative(&[
            ("learning_rates.physics", physics),
            ("learning_rates.prior", prior),
            ("learning_rates.residual", residual),
            ("weight_decay", self.weight_decay),
        ])?;
        if !(self.anneal > 0.0 && self.anneal <= 1.0) {
            return Err(TrainError::Anneal(self.anneal));
        }
        if self.epochs > EPOCHS {
            return Err(TrainError::Epochs(self.epochs));
        }
        self.penalty.check()
    }
}
