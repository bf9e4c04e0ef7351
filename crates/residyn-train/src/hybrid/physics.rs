//! The physical parameters of declared equations as learnable numbers.

use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor};

use super::HybridError;
use super::tensor::{to_f32, vector};
use residyn_core::model::{Dynamics, Parameter};

/// The physical parameters of declared equations, each divided by its scale, so that an optimiser step is relative to
/// the parameter's magnitude.
///
/// They form one tensor: an optimiser needs a dozen operations per tensor, however small. The entries of parameters
/// that are declared fixed are never read.
#[derive(Module, Debug)]
pub struct Physics {
    /// value / scale of each parameter, `[parameters]`.
    pub scaled: Param<Tensor<1>>,
    #[module(skip)]
    declared: Arc<[Parameter]>,
}

impl Physics {
    /// # Errors
    /// A parameter that is not finite, is outside its bounds, or has no scale.
    pub(super) fn new(
        dynamics: &Dynamics,
        id: ParamId,
        device: &Device,
    ) -> Result<Self, HybridError> {
        dynamics.parameters.iter().try_for_each(check)?;
        let parameters = dynamics.parameters.iter();
        let scaled: Vec<f64> = parameters.map(|p| p.value / p.scale).collect();
        Ok(Self {
            scaled: Param::initialized(id, vector(&scaled, device).require_grad()),
            declared: dynamics.parameters.clone().into(),
        })
    }

    /// The names of the parameters, in the order of the tensor's entries.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.declared.iter().map(|p| p.name.as_str())
    }

    /// A parameter in its unit, of shape `[1]`, with its derivative: for a custom penalty. `None` if no parameter has
    /// this name.
    pub fn parameter(&self, name: &str) -> Option<Tensor<1>> {
        let index = self.names().position(|known| known == name)?;
        Some(self.column(index, &self.scaled.val()))
    }

    /// Every parameter in its unit, of shape `[1]` each.
    pub(super) fn columns(&self) -> Vec<Tensor<1>> {
        let scaled = self.scaled.val();
        let indices = 0..self.declared.len();
        indices.map(|index| self.column(index, &scaled)).collect()
    }

    fn column(&self, index: usize, scaled: &Tensor<1>) -> Tensor<1> {
        let parameter = &self.declared[index];
        if parameter.fixed {
            return vector(&[parameter.value], &scaled.device());
        }
        scaled.clone().narrow(0, index, 1) * parameter.scale
    }

    /// The value of every parameter in its unit; fixed parameters keep their declared value to the last bit. A
    /// parameter on a bound stays within it, however it was rounded.
    pub(super) fn values(&self) -> Vec<f64> {
        let scaled = to_f32(self.scaled.val());
        let pairs = self.declared.iter().zip(scaled);
        let values = pairs.map(|(p, scaled)| match p.fixed {
            true => p.value,
            false => (f64::from(scaled) * p.scale).clamp(p.bounds[0], p.bounds[1]),
        });
        values.collect()
    }

    /// The same parameters with other values / scales.
    pub(super) fn with_scaled(&self, scaled: Tensor<1>) -> Self {
        Self {
            scaled: Param::initialized(self.scaled.id, scaled),
            declared: self.declared.clone(),
        }
    }

    /// The same with every parameter clamped to its bounds.
    #[must_use]
    pub(super) fn within_bounds(self) -> Self {
        Self {
            scaled: within_bounds(&self.declared, self.scaled),
            declared: self.declared,
        }
    }
}

/// value / scale of each parameter, clamped to the bounds (projected gradient descent: a parameter may rest on a bound
/// and leave it again). NaN stays NaN.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(crate) fn within_bounds(declared: &[Parameter], scaled: Param<Tensor<1>>) -> Param<Tensor<1>> {
    let is_bounded = |p: &Parameter| p.bounds.iter().any(|bound| bound.is_finite());
    if !declared.iter().any(is_bounded) {
        return scaled;
    }
    scaled.map(|scaled| {
        let device = scaled.device();
        let mut values = to_f32(scaled);
        for (value, p) in values.iter_mut().zip(declared) {
            let [lowest, highest] = p.bounds.map(|bound| (bound / p.scale) as f32);
            *value = value.clamp(lowest, highest);
        }
        Tensor::from_floats(values.as_slice(), &device).require_grad()
    })
}

fn check(p: &Parameter) -> Result<(), HybridError> {
    let scaled = p.scale.is_finite() && p.scale > 0.0;
    let inside = p.bounds[0] <= p.value && p.value <= p.bounds[1];
    if scaled && inside && p.value.is_finite() {
        return Ok(());
    }
    Err(HybridError::Parameter {
        name: p.name.clone(),
        value: p.value,
        scale: p.scale,
        bounds: p.bounds,
    })
}
