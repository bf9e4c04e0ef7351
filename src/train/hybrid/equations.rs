//! The physical parameters of declared equations as learnable numbers, each divided by its scale: an optimiser's step is then
//! relative to each parameter's own magnitude. The entries of fixed parameters are never read.

use burn::tensor::{Device, Tensor};

use super::HybridError;
use super::tensor::vector;
use crate::model::{Dynamics, Parameter};

/// value / scale of every parameter.
///
/// # Errors
/// A parameter that is not finite, outside of its bounds, or without a scale.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(super) fn scaled(dynamics: &Dynamics) -> Result<Vec<f32>, HybridError> {
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
    let parameters = dynamics.parameters.iter();
    Ok(parameters.map(|p| (p.value / p.scale) as f32).collect())
}

/// The equations with these values; fixed ones as declared, to the last bit.
pub(super) fn current(declared: &Dynamics, scaled: &[f32]) -> Dynamics {
    let scaled: Vec<f64> = scaled.iter().copied().map(f64::from).collect();
    let values = values(&declared.parameters, &scaled);
    declared.clone().with_values(values)
}

/// The value of every parameter in its unit; of fixed ones as declared, to the last bit. One that rests on a bound stays
/// within it, however it was rounded.
pub(super) fn values(declared: &[Parameter], scaled: &[f64]) -> impl Iterator<Item = f64> {
    let pairs = declared.iter().zip(scaled);
    pairs.map(|(p, scaled)| match p.fixed {
        true => p.value,
        false => (scaled * p.scale).clamp(p.bounds[0], p.bounds[1]),
    })
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

/// Brings values / scale back within their bounds. What is not a number stays so.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(super) fn project(parameters: &[Parameter], scaled: &mut [f32]) {
    for (value, p) in scaled.iter_mut().zip(parameters) {
        let [lowest, highest] = p.bounds.map(|bound| (bound / p.scale) as f32);
        *value = value.clamp(lowest, highest);
    }
}

fn each(parameters: &[Parameter], value: impl Fn(&Parameter) -> f64, device: &Device) -> Tensor<1> {
    vector(&parameters.iter().map(value).collect::<Vec<_>>(), device)
}
