//! What is saved of a model besides its equations: its learnable numbers in plain form, and their shape.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::call::Call;
use super::{Angles, InputScaling, MlpWeights, Parameter, ResidualOn};

/// All learnable numbers of a model, in plain form.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelWeights {
    /// Values of the physical parameters in their units, in the order of the model's parameters.
    pub parameters: Vec<f64>,
    pub prior: Option<MlpWeights>,
    pub residual: Option<MlpWeights>,
}

/// A model without its learnable numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelShape {
    /// Name of the system.
    pub system: String,
    pub joints: usize,
    /// Empty if the prior is a network.
    pub parameters: Vec<SavedParameter>,
    /// The prior, if it is a network.
    pub prior: Option<SavedNetwork>,
    pub residual: Option<SavedNetwork>,
}

/// What training needs to know about a physical parameter, besides its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedParameter {
    pub name: String,
    pub unit: String,
    pub scale: f64,
    /// None if there is no bound: JSON has no infinity.
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

/// Where a model came from: kept with it, so that its files explain themselves.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// The whole configuration, as resolved.
    pub config: serde_json::Value,
    pub seed: u64,
    /// Text of the model file.
    pub model_toml: String,
    /// For a report: how the program was called. None if a program calls the library.
    pub call: Option<Call>,
}

impl Origin {
    /// The origin of a model in a program that calls the library, with the seed of its random numbers.
    pub fn of_seed(seed: u64) -> Self {
        Self {
            config: serde_json::json!({"command": null}),
            seed,
            model_toml: String::new(),
            call: None,
        }
    }
}

/// Why a file of a saved model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SavedModelError {
    #[error(
        "the checkpoint's file {file:?} is damaged ({reason}); use another copy or train again, in \
         {dir:?}"
    )]
    Corrupt {
        file: String,
        reason: String,
        dir: PathBuf,
    },
    #[error(
        "tensor `{tensor}` in {file:?} has shape {found:?}, but checkpoint.json describes {expected:?}; \
         the files belong to different checkpoints, in {dir:?}"
    )]
    Shape {
        tensor: String,
        file: String,
        expected: Vec<usize>,
        found: Vec<usize>,
        dir: PathBuf,
    },
}

impl ModelShape {
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
    pub fn restore(&self, value: f64) -> Parameter {
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
            per_group: false,
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
