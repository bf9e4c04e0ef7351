use serde::{Deserialize, Serialize};

use crate::model::ModelWeights;

/// One entry of a training run's history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Epochs done when it was taken; 0 is the start.
    pub epoch: usize,
    /// The minimised sum of error and penalty.
    pub loss: f64,
    /// Mean squared error of the training segments.
    pub error: f64,
    /// Norm of the residual F_r; 0 in a model without one.
    pub residual_norm: f64,
    /// Mean squared error of the validation segments, if there are any. Infinite where the model
    /// diverges, which is never kept as the best.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        with = "null_if_infinite"
    )]
    pub validation: Option<f64>,
    /// alpha, or the current lambda.
    pub penalty_weight: f64,
    /// Values of the physical parameters, in their order.
    pub parameters: Vec<f64>,
}

/// The model with the lowest validation error so far.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Best {
    pub epoch: usize,
    pub validation: f64,
    pub weights: ModelWeights,
}

/// JSON has no infinity.
pub(super) mod null_if_infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[allow(clippy::ref_option)] // the signature is serde's
    pub fn serialize<S: Serializer>(value: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
        value.filter(|value| value.is_finite()).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
        let value = Option::<f64>::deserialize(from)?;
        Ok(Some(value.unwrap_or(f64::INFINITY)))
    }
}
