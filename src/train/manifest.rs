use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use super::history::null_if_infinite;
use super::{FitSettings, Record, Training};
use crate::model::{
    Angles, Dynamics, HybridError, HybridModel, InputScaling, MlpWeights, ModelWeights, Parameter,
    ResidualOn,
};

/// The number of the checkpoint format that this program writes and reads.
pub const FORMAT: u64 = 2;

/// `checkpoint.json`: everything about a checkpoint but its large numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    pub format: u64,
    /// The program that wrote it.
    pub residyn: String,
    #[serde(flatten)]
    pub shape: Shape,
    /// The whole configuration of the run, as its caller resolved it.
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

/// A model without its learnable numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Name of the system.
    pub system: String,
    pub joints: usize,
    /// Empty where the prior is a network.
    pub parameters: Vec<SavedParameter>,
    /// The prior, where it is a network.
    pub prior: Option<SavedNetwork>,
    pub residual: Option<SavedNetwork>,
}

/// What training needs to know of a physical parameter, besides its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedParameter {
    pub name: String,
    pub unit: String,
    pub scale: f64,
    /// None where there is no bound: JSON has no infinity.
    pub bounds: [Option<f64>; 2],
    pub fixed: bool,
}

/// The shape of a network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedNetwork {
    /// From the features to the outputs.
    pub widths: Vec<usize>,
    pub angles: Angles,
    pub on: ResidualOn,
    pub scaling: InputScaling,
}

/// When the model in `weights.safetensors` was the present one.
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
            shape: Shape::of(
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

impl Shape {
    /// The shape of a model with these physical parameters and networks.
    pub fn of(
        system: &str,
        joints: usize,
        parameters: &[Parameter],
        weights: &ModelWeights,
    ) -> Self {
        Self {
            system: system.to_owned(),
            joints,
            parameters: parameters.iter().map(SavedParameter::of).collect(),
            prior: weights.prior.as_ref().map(SavedNetwork::of),
            residual: weights.residual.as_ref().map(SavedNetwork::of),
        }
    }

    /// A model of this shape with these numbers, on `device`. `dynamics` is what its model file says.
    ///
    /// # Errors
    /// Numbers or networks that do not make a model.
    pub fn model(
        &self,
        weights: &ModelWeights,
        dynamics: &Dynamics,
        device: &Device,
    ) -> Result<HybridModel, HybridError> {
        let model = match &weights.prior {
            Some(prior) => HybridModel::network(&self.system, self.joints, prior, device)?,
            None => {
                let saved = self.parameters.iter().zip(&weights.parameters);
                let trained = Dynamics {
                    parameters: saved.map(|(p, value)| p.restore(*value)).collect(),
                    ..dynamics.clone()
                };
                HybridModel::physics(&trained, device)?
            }
        };
        match &weights.residual {
            Some(residual) => model.with_residual(residual),
            None => Ok(model),
        }
    }
}

impl SavedParameter {
    fn of(parameter: &Parameter) -> Self {
        let finite = |bound: f64| bound.is_finite().then_some(bound);
        Self {
            name: parameter.name.clone(),
            unit: parameter.unit.clone(),
            scale: parameter.scale,
            bounds: parameter.bounds.map(finite),
            fixed: parameter.fixed,
        }
    }

    /// The parameter as it was trained, with this value.
    pub(crate) fn restore(&self, value: f64) -> Parameter {
        Parameter {
            name: self.name.clone(),
            value,
            unit: self.unit.clone(),
            bounds: [
                self.bounds[0].unwrap_or(f64::NEG_INFINITY),
                self.bounds[1].unwrap_or(f64::INFINITY),
            ],
            fixed: self.fixed,
            per_log: false,
            ci95: None,
            scale: self.scale,
        }
    }
}

impl SavedNetwork {
    fn of(weights: &MlpWeights) -> Self {
        Self {
            widths: weights.widths(),
            angles: weights.angles,
            on: weights.on,
            scaling: weights.scaling.clone(),
        }
    }
}
