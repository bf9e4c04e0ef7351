use std::sync::Arc;

use burn::backend::DispatchTensor;
use burn::module::{Module, ParamId};
use burn::tensor::{Device, Tensor};

use super::flat::flattened;
use super::tensor::Views;
use super::{HybridError, Mlp, Physics, Structure, Unpacked};
use residyn_control::control::Predictor;
use residyn_core::model::{
    Dynamics, MlpWeights, ModelShape, ModelWeights, Parameter, nothing_but, with_residual,
};
use residyn_core::sim::Integrator;

/// Burn's identifiers of the tensors: for the physical parameters, and the first for each network. They do not depend
/// on what was built before, so that an optimiser's record fits a rebuilt model.
const PHYSICS_ID: u64 = 1;
const PRIOR_IDS: u64 = 1 << 32;
const RESIDUAL_IDS: u64 = 2 << 32;

/// ds/dt = F_p(s, a) + F_r(s, a): known dynamics, and a network for the unknown ones.
///
/// F_p, the prior, is either equations with learnable parameters or itself a network. Leaving out F_r gives a
/// physics-only or a data-driven model. States are positions, then velocities: `2n` columns.
///
/// It is a Burn module: `loss.backward()`, optimisers, records, visitors, `no_grad` and moves between devices work as
/// with any other module. `physics`, `prior` and `residual` are the paths of its parameter groups.
#[derive(Module, Debug)]
pub struct HybridModel {
    /// The physical parameters, if the prior is equations.
    pub physics: Option<Physics>,
    /// The prior, if it is a network.
    pub prior: Option<Mlp>,
    /// F_r, if the model has one.
    pub residual: Option<Mlp>,
    #[module(skip)]
    structure: Arc<Structure>,
}

impl HybridModel {
    /// A model of equations alone.
    ///
    /// `device` decides the backend and whether gradients are taken, see
    /// [`Backend::device`](crate::Backend::device).
    ///
    /// # Errors
    /// A parameter that is not finite, is outside its bounds, or has no scale.
    pub fn physics(dynamics: &Dynamics, device: &Device) -> Result<Self, HybridError> {
        let physics = Physics::new(dynamics, ParamId::from(PHYSICS_ID), device)?;
        Ok(Self {
            physics: Some(physics),
            prior: None,
            residual: None,
            structure: Arc::new(Structure::of_equations(dynamics)),
        })
    }

    /// A data-driven model of `system`: dq/dt = qd and dqd/dt = network
    /// ([`ResidualOn::Accelerations`](residyn_core::model::ResidualOn::Accelerations)), or both from the network
    /// ([`ResidualOn::Derivative`](residyn_core::model::ResidualOn::Derivative)).
    ///
    /// # Errors
    /// A network that is not for `joints` joints.
    pub fn network(
        system: &str,
        joints: usize,
        weights: &MlpWeights,
        device: &Device,
    ) -> Result<Self, HybridError> {
        weights.check(joints)?;
        Ok(Self {
            physics: None,
            prior: Some(Mlp::new(weights, PRIOR_IDS, device)),
            residual: None,
            structure: Arc::new(Structure::of_network(system, joints, weights)),
        })
    }

    /// The same model with this residual F_r in place of any existing one.
    ///
    /// # Errors
    /// A network that is not for the model's number of joints, or equations with a transmission.
    pub fn with_residual(self, weights: &MlpWeights) -> Result<Self, HybridError> {
        weights.check(self.joints())?;
        let equations = self.structure.equations.as_ref();
        if equations.is_some_and(Dynamics::has_transmission) {
            return Err(HybridError::Transmission {
                system: self.system().to_owned(),
            });
        }
        Ok(Self {
            residual: Some(Mlp::new(weights, RESIDUAL_IDS, &self.device())),
            structure: Arc::new(self.structure.with_residual(weights)),
            ..self
        })
    }

    /// A saved model, on `device`. `dynamics` is the content of its model file.
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

    /// A model with the networks of `weights`, and with `equations` if its prior is not a network.
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

    /// The physical parameters as declared, with their current values; none if the prior is a network.
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
        ModelWeights {
            parameters: self.parameters().into_iter().map(|(_, v)| v).collect(),
            prior: self.prior.as_ref().map(Mlp::weights),
            residual: self.residual.as_ref().map(Mlp::weights),
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

    /// The whole model, networks included, as one program with the current numbers, as read by f64 integrators,
    /// planners and exporters.
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

    /// The equations with the current values, or their stand-in if the prior is a network; and the networks whose
    /// outputs are added to their derivative.
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

    /// The model for planners; `integrator` is the one that it was trained through.
    pub fn predictor(&self, integrator: Integrator) -> Predictor {
        let (equations, networks) = self.parts();
        Predictor::new(equations, networks, integrator)
    }

    /// The declared equations with the current values.
    fn equations(&self) -> Option<Dynamics> {
        let declared = self.structure.equations.as_ref()?;
        let physics = self.physics.as_ref()?;
        Some(declared.clone().with_values(physics.values()))
    }

    /// Unpacks the physical parameters, once for all evaluations that one gradient runs through.
    pub fn unpack(&self) -> Unpacked<'_> {
        Unpacked::new(self)
    }

    /// The device of the model's tensors.
    pub fn device(&self) -> Device {
        let networks = [&self.prior, &self.residual];
        let of_network = |mlp: &Mlp| mlp.layers.first().map(|layer| layer.weight.device());
        let physics = self.physics.as_ref().map(|physics| physics.scaled.device());
        let mut found = networks.into_iter().flatten().filter_map(of_network);
        let device = physics.or_else(|| found.next());
        device.expect("a prior is equations or a network")
    }

    /// The model without its learnable numbers.
    pub(crate) fn structure(&self) -> &Arc<Structure> {
        &self.structure
    }

    /// All learnable numbers as one tensor, with their derivatives: the physical parameters as value / scale or the layers of
    /// the prior, then the layers of the residual, each layer's weights `[input][output]` before its biases.
    pub(crate) fn flat(&self) -> Tensor<1> {
        let residual = self.residual.iter().flat_map(Mlp::tensors);
        flattened(self.tensors_of_prior().chain(residual).collect())
    }

    /// All learnable numbers as one tensor for the prior and one for the residual.
    pub(crate) fn flat_parts(&self) -> (Tensor<1>, Option<Tensor<1>>) {
        let residual = self.residual.as_ref();
        let residual = residual.map(|residual| flattened(residual.tensors().collect()));
        (flattened(self.tensors_of_prior().collect()), residual)
    }

    fn tensors_of_prior(&self) -> impl Iterator<Item = DispatchTensor> {
        let physics = self.physics.iter();
        let physics = physics.map(|physics| physics.scaled.val().into_dispatch());
        physics.chain(self.prior.iter().flat_map(Mlp::tensors))
    }

    /// The same model with other numbers, views of `flat`.
    pub(crate) fn with_flat(&self, flat: &Tensor<1>) -> Self {
        let mut views = Views::new(flat);
        let parameters = self.structure.parameters().len();
        let physics = self.physics.as_ref();
        let physics = physics.map(|physics| physics.with_scaled(views.next(parameters)));
        let mut network = |mlp: &Mlp| mlp.with_numbers(&mut views);
        Self {
            physics,
            prior: self.prior.as_ref().map(&mut network),
            residual: self.residual.as_ref().map(&mut network),
            structure: self.structure.clone(),
        }
    }

    /// The same model with the physical parameters clamped to their bounds, as after an optimiser step.
    #[must_use]
    pub fn within_bounds(self) -> Self {
        Self {
            physics: self.physics.map(Physics::within_bounds),
            ..self
        }
    }
}
