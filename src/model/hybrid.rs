use std::sync::Arc;

use burn::module::{Module, ParamId};
use burn::tensor::{Device, Tensor};

use super::equations::Equations;
use super::frame::Frame;
use super::mlp::Mlp;
use super::network::{MlpWeights, ResidualOn, network_dynamics, with_residual};
use super::{Dynamics, Parameter};

/// Why a model cannot be put together.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HybridError {
    #[error(
        "a network with layer widths {widths:?} does not fit {joints} joints: it must begin with \
         {features} features, end with {outputs} outputs and have no empty layer; change `hidden`, \
         or take the network that was trained for this system"
    )]
    Network {
        joints: usize,
        features: usize,
        outputs: usize,
        widths: Vec<usize>,
    },
    #[error(
        "parameter `{name}` has value {value}, scale {scale}, bounds {bounds:?}: training needs a \
         finite value, a finite scale above zero and the value within the bounds"
    )]
    Parameter {
        name: String,
        value: f64,
        scale: f64,
        bounds: [f64; 2],
    },
    #[error(
        "{found} parameters or networks of another shape were given to a model of `{system}`, which \
         has {expected} parameters"
    )]
    Weights {
        system: String,
        expected: usize,
        found: usize,
    },
}

// The names of the networks' tensors, by which an optimiser's saved state finds them.
const PRIOR_ID: u64 = 1_000;
const RESIDUAL_ID: u64 = 2_000;

/// ds/dt = F_p(s, a) + F_r(s, a): what is known, and a network for what is not.
///
/// F_p, the prior, is either equations with learnable parameters or itself a network. Leaving out F_r
/// gives a physics-only or a data-driven model. States are positions then velocities, `2n` columns.
#[derive(Module, Debug)]
pub struct HybridModel {
    prior: Prior,
    residual: Option<Mlp>,
    #[module(skip)]
    system: String,
    #[module(skip)]
    joints: usize,
    #[module(skip)]
    frame: Arc<Frame>,
}

// A box would make it smaller, but Burn knows no boxed modules, and there are few models at a time.
#[allow(clippy::large_enum_variant)]
#[derive(Module, Debug)]
enum Prior {
    Equations(Equations),
    Network(Mlp),
}

/// All learnable numbers of a model, in plain form.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelWeights {
    /// Values of the physical parameters in their units, in the order of the model's parameters.
    pub parameters: Vec<f64>,
    pub prior: Option<MlpWeights>,
    pub residual: Option<MlpWeights>,
}

/// ds/dt at a batch of points.
#[derive(Debug, Clone)]
pub struct Flow {
    /// dq/dt then dqd/dt: `2n` columns of shape `[batch]`, or `[1]` where all rows agree.
    pub rates: Vec<Tensor<1>>,
    /// F_r, `[batch, n or 2n]`; none in a model without a residual.
    pub residual: Option<Tensor<2>>,
}

/// A model with its parameters unpacked, for the evaluations of one loss.
#[derive(Debug)]
pub struct Prepared<'m> {
    model: &'m HybridModel,
    parameters: Vec<Tensor<1>>,
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
        let equations = Equations::new(dynamics, device)?;
        Ok(Self {
            prior: Prior::Equations(equations),
            residual: None,
            system: dynamics.name.clone(),
            joints: dynamics.joints,
            frame: Arc::new(Frame::new(dynamics.joints, Some(dynamics), None, None)),
        })
    }

    /// A data-driven model of `system`: dq/dt = qd and dqd/dt = network
    /// ([`ResidualOn::Accelerations`]), or both from the network ([`ResidualOn::Derivative`]).
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
        let prior = Mlp::new(weights, PRIOR_ID, device);
        let frame = Frame::new(joints, None, Some(prior.made()), None);
        Ok(Self {
            prior: Prior::Network(prior),
            residual: None,
            system: system.to_owned(),
            joints,
            frame: Arc::new(frame),
        })
    }

    /// The same model with this residual F_r in place of any that it has.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub fn with_residual(self, weights: &MlpWeights) -> Result<Self, HybridError> {
        weights.check(self.joints)?;
        let residual = Mlp::new(weights, RESIDUAL_ID, &self.device());
        let (equations, prior) = match &self.prior {
            Prior::Equations(equations) => (Some(equations.declared()), None),
            Prior::Network(mlp) => (None, Some(mlp.made())),
        };
        let frame = Frame::new(self.joints, equations, prior, Some(residual.made()));
        Ok(Self {
            residual: Some(residual),
            frame: Arc::new(frame),
            ..self
        })
    }

    /// Name of the system.
    pub fn system(&self) -> &str {
        &self.system
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// The physical parameters as declared, with their current values; none where the prior is a network.
    pub fn declared(&self) -> Vec<Parameter> {
        match &self.prior {
            Prior::Equations(equations) => equations.current().parameters,
            Prior::Network(_) => Vec::new(),
        }
    }

    /// Name and current value of every physical parameter, in its unit.
    pub fn parameters(&self) -> Vec<(String, f64)> {
        let declared = self.declared().into_iter();
        declared.map(|p| (p.name, p.value)).collect()
    }

    /// Current value of one physical parameter.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let mut parameters = self.parameters().into_iter();
        parameters.find(|(n, _)| n == name).map(|(_, value)| value)
    }

    /// Every learnable number.
    pub fn weights(&self) -> ModelWeights {
        ModelWeights {
            parameters: self.parameters().into_iter().map(|(_, v)| v).collect(),
            prior: match &self.prior {
                Prior::Equations(_) => None,
                Prior::Network(mlp) => Some(mlp.weights()),
            },
            residual: self.residual.as_ref().map(Mlp::weights),
        }
    }

    /// The same model with other numbers.
    ///
    /// # Errors
    /// When the numbers belong to a model of another shape.
    pub fn with_weights(&self, weights: &ModelWeights) -> Result<Self, HybridError> {
        let device = self.device();
        let prior = match (&self.prior, &weights.prior) {
            (Prior::Equations(equations), None)
                if equations.declared().parameters.len() == weights.parameters.len() =>
            {
                let mut dynamics = equations.declared().clone();
                for (parameter, value) in dynamics.parameters.iter_mut().zip(&weights.parameters) {
                    parameter.value = *value;
                }
                Self::physics(&dynamics, &device)?
            }
            (Prior::Network(_), Some(mlp)) if weights.parameters.is_empty() => {
                Self::network(&self.system, self.joints, mlp, &device)?
            }
            (prior, _) => return Err(self.foreign(prior, weights)),
        };
        match &weights.residual {
            Some(mlp) => prior.with_residual(mlp),
            None => Ok(prior),
        }
    }

    fn foreign(&self, prior: &Prior, weights: &ModelWeights) -> HybridError {
        HybridError::Weights {
            system: self.system.clone(),
            expected: match prior {
                Prior::Equations(equations) => equations.declared().parameters.len(),
                Prior::Network(_) => 0,
            },
            found: weights.parameters.len(),
        }
    }

    /// The whole model, networks included, as one program with the current numbers: what integrators in
    /// f64, planners and exporters read.
    ///
    /// # Errors
    /// None for a model made by this module's constructors.
    pub fn to_dynamics(&self) -> Result<Dynamics, HybridError> {
        let prior = match &self.prior {
            Prior::Equations(equations) => equations.current(),
            Prior::Network(mlp) => network_dynamics(&self.system, self.joints, &mlp.weights())?,
        };
        match &self.residual {
            Some(mlp) => with_residual(&prior, &mlp.weights()),
            None => Ok(prior),
        }
    }

    /// Unpack the parameters, once for all evaluations that one gradient runs through.
    pub fn prepare(&self) -> Prepared<'_> {
        Prepared {
            model: self,
            parameters: match &self.prior {
                Prior::Equations(equations) => equations.columns(),
                Prior::Network(_) => Vec::new(),
            },
        }
    }

    /// ds/dt and the part F_r of it that the residual makes, at a batch of points.
    ///
    /// `state` is `[batch, 2n]` (positions, velocities), `input` `[batch, n]`, `time` `[batch]` in
    /// seconds. Returns `[batch, 2n]` and, where the model has a residual, `[batch, n or 2n]`.
    pub fn derivative(
        &self,
        state: Tensor<2>,
        input: Tensor<2>,
        time: &Tensor<1>,
    ) -> (Tensor<2>, Option<Tensor<2>>) {
        let batch = state.dims()[0];
        let flow = self.prepare().flow(&columns(state), &columns(input), time);
        let rates = flow.rates.into_iter().map(|rate| rate.expand([batch]));
        (Tensor::stack(rates.collect(), 1), flow.residual)
    }

    /// Bring every physical parameter back within its bounds. Called after each optimiser step
    /// (projected gradient descent): a parameter may rest on a bound and leave it again.
    #[must_use]
    pub fn project(self) -> Self {
        let prior = match self.prior {
            Prior::Equations(equations) => Prior::Equations(equations.project()),
            network @ Prior::Network(_) => network,
        };
        Self { prior, ..self }
    }

    /// The device that the model was made on.
    pub fn device(&self) -> Device {
        match &self.prior {
            Prior::Equations(equations) => equations.device(),
            Prior::Network(mlp) => mlp.device(),
        }
    }

    /// What the model is without its learnable numbers.
    pub(crate) fn frame(&self) -> &Arc<Frame> {
        &self.frame
    }

    /// The learnable numbers: the prior's (its parameters divided by their scales, or its network), and the
    /// residual's.
    pub(crate) fn tensors(&self) -> (Tensor<1>, Option<Tensor<1>>) {
        let prior = match &self.prior {
            Prior::Equations(equations) => equations.scaled(),
            Prior::Network(mlp) => mlp.flat(),
        };
        (prior, self.residual.as_ref().map(Mlp::flat))
    }

    /// The optimiser's names of the parameters of: the equations, the prior network, the residual.
    pub(crate) fn ids(&self) -> [Vec<ParamId>; 3] {
        let (equations, network) = match &self.prior {
            Prior::Equations(equations) => (vec![equations.id()], Vec::new()),
            Prior::Network(mlp) => (Vec::new(), vec![mlp.id()]),
        };
        let residual = self.residual.iter().map(Mlp::id).collect();
        [equations, network, residual]
    }
}

impl Prepared<'_> {
    /// ds/dt for columns of shape `[batch]`: `2n` states, `n` inputs held, time in seconds.
    pub fn flow(&self, state: &[Tensor<1>], input: &[Tensor<1>], time: &Tensor<1>) -> Flow {
        let (q, qd) = state.split_at(self.model.joints);
        let mut rates = match &self.model.prior {
            Prior::Equations(equations) => {
                let mut inputs = state.to_vec();
                inputs.extend_from_slice(input);
                inputs.push(time.clone());
                inputs.extend_from_slice(&self.parameters);
                equations.declared().program.replay(&inputs)
            }
            Prior::Network(mlp) => {
                let outputs = columns(mlp.forward(q, qd, input));
                match mlp.on() {
                    ResidualOn::Accelerations => qd.iter().cloned().chain(outputs).collect(),
                    ResidualOn::Derivative => outputs,
                }
            }
        };
        let mlp = self.model.residual.as_ref();
        let residual = mlp.map(|mlp| mlp.forward(q, qd, input));
        if let Some(residual) = residual.clone() {
            let parts = columns(residual);
            let first = rates.len() - parts.len();
            for (rate, part) in rates[first..].iter_mut().zip(parts) {
                *rate = rate.clone() + part;
            }
        }
        Flow { rates, residual }
    }
}

/// The columns of a matrix `[batch, width]`.
fn columns(matrix: Tensor<2>) -> Vec<Tensor<1>> {
    let [batch, width] = matrix.dims();
    if width == 1 {
        return vec![matrix.reshape([batch])];
    }
    (0..width)
        .map(|k| matrix.clone().slice([0..batch, k..k + 1]).reshape([batch]))
        .collect()
}
