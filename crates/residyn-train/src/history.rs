use serde::{Deserialize, Deserializer, Serialize};

use residyn_core::model::ModelWeights;

/// One entry of a training run's history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Epochs done when the entry was recorded; 0 is the start.
    pub epoch: usize,
    /// The minimised sum of error and penalty.
    pub loss: f64,
    /// Mean squared error of the training segments.
    pub error: f64,
    /// Norm of the residual F_r; 0 in a model without one.
    pub residual_norm: f64,
    /// Mean squared error of the validation segments, if there are any. Infinite if the model diverges; such a model is
    /// never kept as the best.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "infinite_if_null"
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

/// JSON has no infinity; it is written as null.
pub(super) fn infinite_if_null<'de, D: Deserializer<'de>, T: From<f64>>(
    from: D,
) -> Result<T, D::Error> {
    let value = Option::<f64>::deserialize(from)?;
    Ok(value.unwrap_or(f64::INFINITY).into())
}
