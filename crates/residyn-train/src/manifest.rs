use serde::{Deserialize, Serialize};

use super::history::infinite_if_null;
use super::{FitSettings, Record, Training};
use residyn_core::model::{ModelShape, Origin};
use residyn_io::files::content_id;

/// The number of the checkpoint format that this program writes and reads.
pub const FORMAT: u64 = 3;

/// `checkpoint.json`: everything in a checkpoint except its weights.
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
    /// A hash of the optimiser's state.
    pub optimizer: String,
    pub best: Option<SavedBest>,
    pub history: Vec<Record>,
}

/// The epoch and the validation error of the model in `weights.safetensors`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedBest {
    pub epoch: usize,
    #[serde(deserialize_with = "infinite_if_null")]
    pub validation: f64,
}

impl Manifest {
    pub(super) fn of(
        training: &Training,
        shape: ModelShape,
        origin: &Origin,
        optimizer: &[u8],
    ) -> Self {
        Self {
            format: FORMAT,
            residyn: env!("CARGO_PKG_VERSION").to_owned(),
            shape,
            config: origin.config.clone(),
            seed: origin.seed,
            settings: training.settings.clone(),
            epoch: training.epoch,
            penalty_weight: training.penalty_weight,
            rng: training.rng.clone(),
            optimizer: content_id(optimizer),
            best: training.best.as_ref().map(|best| SavedBest {
                epoch: best.epoch,
                validation: best.validation,
            }),
            history: training.history.clone(),
        }
    }
}
