use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};

use super::mlp::{to_f32, to_f64};
use super::{Dynamics, HybridError, Parameter};

// A fixed number, unlike Burn's random ones, lets an optimiser's saved state find its tensor again.
const EQUATIONS_ID: u64 = 1;

/// Equations as a program, their parameters as one tensor.
#[derive(Module, Debug)]
pub(super) struct Equations {
    /// value / scale of every parameter, `[parameters]`: an optimiser's step is then relative to each
    /// parameter's own magnitude. The entries of fixed parameters are never read.
    scaled: Param<Tensor<1>>,
    scales: Tensor<1>,
    /// Bounds of `scaled`.
    lowest: Tensor<1>,
    highest: Tensor<1>,
    #[module(skip)]
    dynamics: Arc<Dynamics>,
}

impl Equations {
    /// # Errors
    /// A parameter that is not finite, outside of its bounds, or without a scale.
    pub(super) fn new(dynamics: &Dynamics, device: &Device) -> Result<Self, HybridError> {
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
        let tensor = |value: fn(&Parameter) -> f64| {
            let values: Vec<f64> = dynamics.parameters.iter().map(value).collect();
            let shape = [values.len()];
            Tensor::<1>::from_data(TensorData::new(to_f32(&values), shape), device)
        };
        Ok(Self {
            scaled: Param::initialized(
                ParamId::from(EQUATIONS_ID),
                tensor(|p| p.value / p.scale).require_grad(),
            ),
            scales: tensor(|p| p.scale),
            lowest: tensor(|p| p.bounds[0] / p.scale),
            highest: tensor(|p| p.bounds[1] / p.scale),
            dynamics: Arc::new(dynamics.clone()),
        })
    }

    /// The equations with the values that they were made with.
    pub(super) fn declared(&self) -> &Dynamics {
        &self.dynamics
    }

    pub(super) fn device(&self) -> Device {
        self.scales.device()
    }

    /// The optimiser's name of the parameters.
    pub(super) fn id(&self) -> ParamId {
        self.scaled.id
    }

    /// value / scale of every parameter.
    pub(super) fn scaled(&self) -> Tensor<1> {
        self.scaled.val()
    }

    /// The equations with the current values; fixed ones as declared, to the last bit.
    pub(super) fn current(&self) -> Dynamics {
        let mut dynamics = (*self.dynamics).clone();
        let scaled = to_f64(self.scaled.val());
        for (parameter, scaled) in dynamics.parameters.iter_mut().zip(scaled) {
            if !parameter.fixed {
                parameter.value = scaled * parameter.scale;
            }
        }
        dynamics
    }

    /// One tensor of shape `[1]` for each parameter.
    pub(super) fn columns(&self) -> Vec<Tensor<1>> {
        let parameters = &self.dynamics.parameters;
        if parameters.is_empty() {
            return Vec::new();
        }
        let values = self.scaled.val() * self.scales.clone();
        (parameters.iter().enumerate())
            .map(|(k, parameter)| {
                if parameter.fixed {
                    let value = to_f32(&[parameter.value]);
                    Tensor::from_data(TensorData::new(value, [1]), &self.scales.device())
                } else {
                    values.clone().narrow(0, k, 1)
                }
            })
            .collect()
    }

    /// Bring every parameter back within its bounds.
    pub(super) fn project(self) -> Self {
        let bounded = |p: &Parameter| p.bounds.iter().any(|bound| bound.is_finite());
        if !self.dynamics.parameters.iter().any(bounded) {
            return self;
        }
        let (lowest, highest) = (self.lowest.clone().inner(), self.highest.clone().inner());
        let scaled = self.scaled.map(|scaled| {
            let inside = scaled.inner().max_pair(lowest).min_pair(highest);
            Tensor::from_inner(inside).require_grad()
        });
        Self { scaled, ..self }
    }
}
