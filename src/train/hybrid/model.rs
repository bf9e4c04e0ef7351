use std::sync::Arc;

use burn::tensor::{Device, Tensor};

use super::tensor::{rows_of, vector_of_f32};
use super::{HybridError, Structure, Unpacked, equations};
use crate::control::Predictor;
use crate::model::{
    Dynamics, MlpWeights, ModelShape, ModelWeights, Parameter, nothing_but, to_f32, with_residual,
};
use crate::sim::Integrator;

/// Learnable numbers of the prior and of the residual.
pub(in crate::train) type Numbers = [Vec<f32>; 2];

/// ds/dt = F_p(s, a) + F_r(s, a): what is known, and a network for what is not.
///
/// F_p, the prior, is either equations with learnable parameters or itself a network. Leaving out F_r
/// gives a physics-only or a data-driven model. States are positions then velocities, `2n` columns.
#[derive(Debug, Clone)]
pub struct HybridModel {
    /// value / scale of each physical parameter, or the prior network's numbers, see [`MlpWeights::flat`]; and the
    /// residual network's.
    numbers: Numbers,
    structure: Arc<Structure>,
    device: Device,
}

impl HybridModel {
    /// A model of equations alone.
    ///
    /// `device` decides the backend and whether gradients are taken, see
    /// [`Backend::device`](crate::train::Backend::device).
    ///
    /// # Errors
    /// A parameter that is not finite, outside of its bounds, or without a scale.
    pub fn physics(dynamics: &Dynamics, device: &Device) -> Result<Self, HybridError> {
        Ok(Self {
            numbers: [equations::scaled(dynamics)?, Vec::new()],
            structure: Arc::new(Structure::of_equations(dynamics)),
            device: device.clone(),
        })
    }

    /// A data-driven model of `system`: dq/dt = qd and dqd/dt = network
    /// ([`ResidualOn::Accelerations`](crate::model::ResidualOn::Accelerations)), or both from the network
    /// ([`ResidualOn::Derivative`](crate::model::ResidualOn::Derivative)).
    ///
    /// # Errors
    /// A network that is not one for `joints` joints.
    pub fn network(
        system: &str,
        joints: usize,
        weights: &MlpWeights,
        device: &Device,
    ) -> Result<Self, HybridError> {
        weights.check(joints)?;
        Ok(Self {
            numbers: [to_f32(&weights.flat()), Vec::new()],
            structure: Arc::new(Structure::of_network(system, joints, weights)),
            device: device.clone(),
        })
    }

    /// The same model with this residual F_r in place of any that it has.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub fn with_residual(self, weights: &MlpWeights) -> Result<Self, HybridError> {
        weights.check(self.joints())?;
        let [prior, _] = self.numbers;
        Ok(Self {
            numbers: [prior, to_f32(&weights.flat())],
            structure: Arc::new(self.structure.with_residual(weights)),
            ..self
        })
    }

    /// A saved model, on `device`. `dynamics` is what its model file says.
    ///
    /// # Errors
    /// Numbers or networks that do not make a model.
    pub fn restored(
        shape: &ModelShape,
        weights: &ModelWeights,
        dynamics: &Dynamics,
        device: &Device,
    ) -> Result<Self, HybridError> {
        let equations = || {
            let saved = shape.parameters.iter().zip(&weights.parameters);
            Dynamics {
                parameters: saved.map(|(p, value)| p.restore(*value)).collect(),
                ..dynamics.clone()
            }
        };
        Self::assembled(&shape.system, shape.joints, equations, weights, device)
    }

    /// A model with the networks of `weights`, and with `equations` where its prior is none of these.
    fn assembled(
        system: &str,
        joints: usize,
        equations: impl FnOnce() -> Dynamics,
        weights: &ModelWeights,
        device: &Device,
    ) -> Result<Self, HybridError> {
        let model = match &weights.prior {
            Some(prior) => Self::network(system, joints, prior, device)?,
            None => Self::physics(&equations(), device)?,
        };
        match &weights.residual {
            Some(residual) => model.with_residual(residual),
            None => Ok(model),
        }
    }

    /// Name of the system.
    pub fn system(&self) -> &str {
        &self.structure.system
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.structure.joints
    }

    /// The physical parameters as declared, with their current values; none where the prior is a network.
    pub fn declared(&self) -> Vec<Parameter> {
        let equations = self.equations();
        equations.map_or_else(Vec::new, |dynamics| dynamics.parameters)
    }

    /// Name and current value of every physical parameter, in its unit.
    pub fn parameters(&self) -> Vec<(String, f64)> {
        let declared = self.declared().into_iter();
        declared.map(|p| (p.name, p.value)).collect()
    }

    /// Every learnable number.
    pub fn weights(&self) -> ModelWeights {
        let network = |made: Option<&MlpWeights>, numbers: &[f32]| {
            let numbers: Vec<f64> = numbers.iter().copied().map(f64::from).collect();
            Some(made?.with_flat(&numbers))
        };
        let [prior, residual] = &self.numbers;
        ModelWeights {
            parameters: self.parameters().into_iter().map(|(_, v)| v).collect(),
            prior: network(self.structure.prior(), prior),
            residual: network(self.structure.residual(), residual),
        }
    }

    /// The same model with other numbers.
    ///
    /// # Errors
    /// When the numbers belong to a model of another shape.
    pub fn with_weights(&self, weights: &ModelWeights) -> Result<Self, HybridError> {
        let (expected, found) = (self.structure.parameters().len(), weights.parameters.len());
        let declared = self.structure.equations.as_ref();
        if expected != found || declared.is_some() == weights.prior.is_some() {
            return Err(HybridError::Weights {
                system: self.system().to_owned(),
                expected,
                found,
            });
        }
        let equations = || {
            let declared = declared.expect("a prior is equations or a network");
            let values = weights.parameters.iter().copied();
            declared.clone().with_values(values)
        };
        let (system, joints, device) = (self.system(), self.joints(), self.device());
        Self::assembled(system, joints, equations, weights, &device)
    }

    /// The whole model, networks included, as one program with the current numbers: what integrators in
    /// f64, planners and exporters read.
    ///
    /// # Errors
    /// None for a model made by this module's constructors.
    pub fn to_dynamics(&self) -> Result<Dynamics, HybridError> {
        let (around, networks) = self.parts();
        let whole = networks.iter().try_fold(around, |dynamics, network| {
            with_residual(&dynamics, network)
        });
        Ok(whole?)
    }

    /// The equations with the current values, or what stands in their place where the prior is a network; and the
    /// networks whose outputs are added to their derivative.
    pub fn parts(&self) -> (Dynamics, Vec<MlpWeights>) {
        let ModelWeights {
            prior, residual, ..
        } = self.weights();
        let around = match (self.equations(), &prior) {
            (Some(dynamics), _) => dynamics,
            (None, prior) => {
                let prior = prior.as_ref().expect("a prior is equations or a network");
                nothing_but(self.system(), self.joints(), prior.on)
            }
        };
        (around, prior.into_iter().chain(residual).collect())
    }

    /// The model as planners take it; `integrator` is the one that it was trained through.
    pub fn predictor(&self, integrator: Integrator) -> Predictor {
        let (equations, networks) = self.parts();
        Predictor::new(equations, networks, integrator)
    }

    /// The declared equations with the current values.
    fn equations(&self) -> Option<Dynamics> {
        let declared = self.structure.equations.as_ref()?;
        Some(equations::current(declared, &self.numbers[0]))
    }

    /// Unpacks the learnable numbers for evaluations without a gradient.
    pub fn unpack(&self) -> Unpacked<'_> {
        self.unpack_tensors(&self.tensors())
    }

    /// Unpacks the model's [`HybridModel::tensors`], once for all evaluations that one gradient runs through.
    pub(in crate::train) fn unpack_tensors(&self, tensors: &[Tensor<1>; 2]) -> Unpacked<'_> {
        let tensors = tensors.clone().map(|numbers| rows_of(numbers, 1));
        Unpacked::new(&self.structure, 1, tensors)
    }

    /// The device that the model was made on.
    pub fn device(&self) -> Device {
        self.device.clone()
    }

    /// The model without its learnable numbers.
    pub(crate) fn structure(&self) -> &Arc<Structure> {
        &self.structure
    }

    /// The same model on the device without gradients.
    #[must_use]
    pub(in crate::train) fn without_gradients(&self) -> Self {
        Self {
            device: self.device().without_autodiff(),
            ..self.clone()
        }
    }

    /// The learnable numbers of the prior and of the residual; none where there is no residual.
    pub(in crate::train) fn numbers(&self) -> &Numbers {
        &self.numbers
    }

    /// The numbers as tensors of their own on the model's device.
    pub(in crate::train) fn tensors(&self) -> [Tensor<1>; 2] {
        let numbers = self.numbers.each_ref();
        numbers.map(|numbers| vector_of_f32(numbers, &self.device).require_grad())
    }

    /// Applies `step` to the learnable numbers, then brings physical parameters back within their bounds (projected gradient
    /// descent): a parameter may rest on a bound and leave it again.
    pub(in crate::train) fn update(&mut self, step: impl FnOnce(&mut Numbers)) {
        step(&mut self.numbers);
        equations::project(self.structure.parameters(), &mut self.numbers[0]);
    }
}
