//! The physical parameters of declared equations as one tensor, each divided by its scale: an optimiser's step is then
//! relative to each parameter's own magnitude. The entries of fixed parameters are never read.

use burn::tensor::{Device, Tensor, TensorData};

use super::HybridError;
use super::tensor::{to_f64, vector};
use crate::model::{Dynamics, Parameter};

/// value / scale of every parameter, `[parameters]`.
///
/// # Errors
/// A parameter that is not finite, outside of its bounds, or without a scale.
pub(super) fn scaled(dynamics: &Dynamics, device: &Device) -> Result<Tensor<1>, HybridError> {
    for p in &dynamics.parameters {
        let scaled = p.scale.is_finite() && p.scale > 0.0;
        let inside = p.bounds[0] <= p.value && p.value <= p.bounds[1];
        if !(scaled && inside && p.value.is_finite()) {
            return Err(HybridError::Parameter {
                name: p.name.clone(),
                value: p.value,
                scale: p.scale,
                bounds: p.bounds,
            });
        }
    }
    Ok(each(&dynamics.parameters, |p| p.value / p.scale, device))
}

/// The equations with these values; fixed ones as declared, to the last bit.
pub(super) fn current(declared: &Dynamics, scaled: Tensor<1>) -> Dynamics {
    let scaled = to_f64(scaled);
    let values = values(&declared.parameters, &scaled);
    declared.clone().with_values(values)
}

/// The value of every parameter in its unit; of fixed ones as declared, to the last bit.
pub(super) fn values(declared: &[Parameter], scaled: &[f64]) -> impl Iterator<Item = f64> {
    let pairs = declared.iter().zip(scaled);
    pairs.map(|(p, scaled)| if p.fixed { p.value } else { scaled * p.scale })
}

/// Every parameter in its unit, from value / scale `[models, parameters]`: a tensor of shape `[models * rows]`, each
/// model's value in `rows` entries, or `[1]` for a fixed one.
pub(super) fn columns(parameters: &[Parameter], scaled: Tensor<2>, rows: usize) -> Vec<Tensor<1>> {
    if parameters.is_empty() {
        return Vec::new();
    }
    let (device, models) = (scaled.device(), scaled.dims()[0]);
    let values = scaled * each(parameters, |p| p.scale, &device).unsqueeze();
    (parameters.iter().enumerate())
        .map(|(k, parameter)| {
            if parameter.fixed {
                each(std::slice::from_ref(parameter), |p| p.value, &device)
            } else {
                let column = values.clone().narrow(1, k, 1);
                column.expand([models, rows]).reshape([models * rows])
            }
        })
        .collect()
}

/// The values brought back within their bounds; none where they are there already.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(super) fn projected(parameters: &[Parameter], scaled: &Tensor<1>) -> Option<Tensor<1>> {
    let bounded = |p: &Parameter| p.bounds.iter().any(|bound| bound.is_finite());
    if !parameters.iter().any(bounded) {
        return None;
    }
    let mut values: Vec<f32> = scaled.to_data().iter().collect();
    let mut moved = false;
    for (value, p) in values.iter_mut().zip(parameters) {
        let [lowest, highest] = p.bounds.map(|bound| (bound / p.scale) as f32);
        let inside = value.clamp(lowest, highest);
        moved |= inside != *value;
        *value = inside;
    }
    let shape = [values.len()];
    moved.then(|| Tensor::from_data(TensorData::new(values, shape), &scaled.device()))
}

fn each(parameters: &[Parameter], value: impl Fn(&Parameter) -> f64, device: &Device) -> Tensor<1> {
    vector(&parameters.iter().map(value).collect::<Vec<_>>(), device)
}
