use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor};

use super::tensor::{rows_of, to_f64, vector};
use super::{HybridError, Prepared, Structure, equations};
use crate::control::Predictor;
use crate::model::{
    Dynamics, MlpWeights, ModelShape, ModelWeights, Parameter, nothing_but, with_residual,
};
use crate::sim::Integrator;

// Burn's identifiers of the tensors.
pub(in crate::train) const PRIOR_ID: u64 = 1;
pub(in crate::train) const RESIDUAL_ID: u64 = 2;

/// ds/dt = F_p(s, a) + F_r(s, a): what is known, and a network for what is not.
///
/// F_p, the prior, is either equations with learnable parameters or itself a network. Leaving out F_r
/// gives a physics-only or a data-driven model. States are positions then velocities, `2n` columns.
#[derive(Module, Debug)]
pub struct HybridModel {
    // One tensor for each part: the cost of an optimiser's step grows with the number of tensors.
    /// value / scale of each physical parameter, or the prior network's numbers, see [`MlpWeights::flat`].
    prior: Param<Tensor<1>>,
    /// The residual network's numbers.
    residual: Option<Param<Tensor<1>>>,
    #[module(skip)]
    structure: Arc<Structure>,
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
            prior: learnable(PRIOR_ID, equations::scaled(dynamics, device)?),
            residual: None,
            structure: Arc::new(Structure::of_equations(dynamics)),
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
            prior: learnable(PRIOR_ID, vector(&weights.flat(), device)),
            residual: None,
            structure: Arc::new(Structure::of_network(system, joints, weights)),
        })
    }

    /// The same model with this residual F_r in place of any that it has.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub fn with_residual(self, weights: &MlpWeights) -> Result<Self, HybridError> {
        weights.check(self.joints())?;
        Ok(Self {
            residual: Some(learnable(
                RESIDUAL_ID,
                vector(&weights.flat(), &self.device()),
            )),
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
        ModelWeights {
            parameters: self.parameters().into_iter().map(|(_, v)| v).collect(),
            prior: self.network_of(self.structure.prior(), Some(&self.prior)),
            residual: self.network_of(self.structure.residual(), self.residual.as_ref()),
        }
    }

    fn network_of(
        &self,
        made: Option<&MlpWeights>,
        numbers: Option<&Param<Tensor<1>>>,
    ) -> Option<MlpWeights> {
        Some(made?.with_flat(&to_f64(numbers?.val())))
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
        Some(equations::current(declared, self.prior.val()))
    }

    /// Unpacks the learnable numbers, once for all evaluations that one gradient runs through.
    pub fn prepare(&self) -> Prepared<'_> {
        let each = |tensor: Option<Tensor<1>>| tensor.and_then(|numbers| rows_of(numbers, 1));
        Prepared::new(&self.structure, 1, self.tensors().map(each))
    }

    /// Brings every physical parameter back within its bounds, after each optimiser step (projected gradient descent): a
    /// parameter may rest on a bound and leave it again.
    #[must_use]
    pub fn project(self) -> Self {
        let prior = self.prior.val().inner();
        match equations::projected(self.structure.parameters(), &prior) {
            Some(inside) => Self {
                prior: learnable(PRIOR_ID, Tensor::from_inner(inside)),
                ..self
            },
            None => self,
        }
    }

    /// The device that the model was made on.
    pub fn device(&self) -> Device {
        self.prior.val().device()
    }

    /// The model without its learnable numbers.
    pub(crate) fn structure(&self) -> &Arc<Structure> {
        &self.structure
    }

    /// The learnable numbers of the prior and of the residual.
    pub(in crate::train) fn tensors(&self) -> [Option<Tensor<1>>; 2] {
        [
            Some(self.prior.val()),
            self.residual.as_ref().map(Param::val),
        ]
    }

    /// The same model with these learnable numbers, where some are given.
    pub(in crate::train) fn with_tensors(&self, tensors: [Option<Tensor<1>>; 2]) -> Self {
        let [prior, residual] = tensors;
        let prior = prior.map(|tensor| learnable(PRIOR_ID, tensor));
        let residual = residual.map(|tensor| learnable(RESIDUAL_ID, tensor));
        Self {
            prior: prior.unwrap_or_else(|| self.prior.clone()),
            residual: residual.or_else(|| self.residual.clone()),
            structure: self.structure.clone(),
        }
    }
}

fn learnable(id: u64, tensor: Tensor<1>) -> Param<Tensor<1>> {
    Param::initialized(ParamId::from(id), tensor.require_grad())
}
