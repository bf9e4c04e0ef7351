use serde::{Deserialize, Serialize};

use super::history::null_if_infinite;
use super::{FitSettings, Record, Training};
use crate::model::ModelShape;

/// The number of the checkpoint format that this program writes and reads.
pub const FORMAT: u64 = 2;

/// `checkpoint.json`: everything about a checkpoint but its weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    pub format: u64,
    /// The program that wrote it.
    pub residyn: String,
    #[serde(flatten)]
    pub shape: ModelShape,
    /// The configuration of the run, as resolved.
    pub config: serde_json::Value,
    pub seed: u64,
    pub settings: FitSettings,
    /// Epochs done.
    pub epoch: usize,
    /// alpha or lambda.
    pub penalty_weight: f64,
    pub rng: rand_chacha::ChaCha8Rng,
    /// Steps that Adam has taken with the prior and with the residual.
    pub optimizer_steps: [usize; 2],
    pub best: Option<SavedBest>,
    pub history: Vec<Record>,
}

/// The epoch and the validation error of the model in `weights.safetensors`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedBest {
    pub epoch: usize,
    #[serde(with = "null_if_infinite")]
    pub validation: Option<f64>,
}

impl Manifest {
    pub(super) fn of(
        training: &Training,
        config: &serde_json::Value,
        seed: u64,
        optimizer_steps: [usize; 2],
    ) -> Self {
        let weights = training.model.weights();
        Self {
            format: FORMAT,
            residyn: env!("CARGO_PKG_VERSION").to_owned(),
            shape: ModelShape::of(
                training.model.system(),
                training.model.joints(),
                &training.model.declared(),
                &weights,
            ),
            config: config.clone(),
            seed,
            settings: training.settings.clone(),
            epoch: training.epoch,
            penalty_weight: training.penalty_weight,
            rng: training.rng.clone(),
            optimizer_steps,
            best: training.best.as_ref().map(|best| SavedBest {
                epoch: best.epoch,
                validation: Some(best.validation),
            }),
            history: training.history.clone(),
        }
    }
}
