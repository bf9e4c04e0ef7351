use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor};

use super::equations;
use super::frame::Frame;
use super::mlp::{Mlp, flat, to_f64};
use super::network::{MlpWeights, ResidualOn, nothing_but, with_residual};
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

// The names by which Burn knows the tensors.
pub(crate) const PRIOR_ID: u64 = 1;
pub(crate) const RESIDUAL_ID: u64 = 2;

/// ds/dt = F_p(s, a) + F_r(s, a): what is known, and a network for what is not.
///
/// F_p, the prior, is either equations with learnable parameters or itself a network. Leaving out F_r
/// gives a physics-only or a data-driven model. States are positions then velocities, `2n` columns.
#[derive(Module, Debug)]
pub struct HybridModel {
    // One tensor for each part: an optimiser's step costs by the tensor.
    /// value / scale of each physical parameter, or the prior network's numbers, see [`MlpWeights::flat`].
    prior: Param<Tensor<1>>,
    /// The residual network's numbers.
    residual: Option<Param<Tensor<1>>>,
    #[module(skip)]
    frame: Arc<Frame>,
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

/// A model, or several of one frame, with the parameters unpacked for the evaluations of one loss.
#[derive(Debug)]
pub struct Prepared<'m> {
    frame: &'m Frame,
    parameters: Vec<Tensor<1>>,
    prior: Option<Mlp<'m>>,
    residual: Option<Mlp<'m>>,
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
            frame: Arc::new(Frame::of_equations(dynamics)),
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
        Ok(Self {
            prior: learnable(PRIOR_ID, flat(weights, device)),
            residual: None,
            frame: Arc::new(Frame::of_network(system, joints, weights)),
        })
    }

    /// The same model with this residual F_r in place of any that it has.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub fn with_residual(self, weights: &MlpWeights) -> Result<Self, HybridError> {
        weights.check(self.joints())?;
        Ok(Self {
            residual: Some(learnable(RESIDUAL_ID, flat(weights, &self.device()))),
            frame: Arc::new(self.frame.with_residual(weights)),
            ..self
        })
    }

    /// Name of the system.
    pub fn system(&self) -> &str {
        &self.frame.system
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.frame.joints
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

    /// Current value of one physical parameter.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let mut parameters = self.parameters().into_iter();
        parameters.find(|(n, _)| n == name).map(|(_, value)| value)
    }

    /// Every learnable number.
    pub fn weights(&self) -> ModelWeights {
        ModelWeights {
            parameters: self.parameters().into_iter().map(|(_, v)| v).collect(),
            prior: self.network_of(self.frame.prior(), Some(&self.prior)),
            residual: self.network_of(self.frame.residual(), self.residual.as_ref()),
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
        let device = self.device();
        let prior = match (&self.frame.equations, &weights.prior) {
            (Some(equations), None) if equations.parameters.len() == weights.parameters.len() => {
                let values = weights.parameters.iter().copied();
                Self::physics(&equations.clone().with_values(values), &device)?
            }
            (None, Some(mlp)) if weights.parameters.is_empty() => {
                Self::network(self.system(), self.joints(), mlp, &device)?
            }
            _ => {
                return Err(HybridError::Weights {
                    system: self.system().to_owned(),
                    expected: self.frame.parameters().len(),
                    found: weights.parameters.len(),
                });
            }
        };
        match &weights.residual {
            Some(mlp) => prior.with_residual(mlp),
            None => Ok(prior),
        }
    }

    /// The whole model, networks included, as one program with the current numbers: what integrators in
    /// f64, planners and exporters read.
    ///
    /// # Errors
    /// None for a model made by this module's constructors.
    pub fn to_dynamics(&self) -> Result<Dynamics, HybridError> {
        let (around, networks) = self.parts();
        networks.iter().try_fold(around, |dynamics, network| {
            with_residual(&dynamics, network)
        })
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

    /// The declared equations with the current values.
    fn equations(&self) -> Option<Dynamics> {
        let declared = self.frame.equations.as_ref()?;
        Some(equations::current(declared, self.prior.val()))
    }

    /// Unpack the parameters, once for all evaluations that one gradient runs through.
    pub fn prepare(&self) -> Prepared<'_> {
        let each = |tensor: Option<Tensor<1>>| tensor.and_then(|numbers| rows_of(numbers, 1));
        Prepared::new(&self.frame, 1, self.tensors().map(each))
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
        let prior = self.prior.val().inner();
        match equations::projected(self.frame.parameters(), &prior) {
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

    /// What the model is without its learnable numbers.
    pub(crate) fn frame(&self) -> &Arc<Frame> {
        &self.frame
    }

    /// The learnable numbers of the prior and of the residual.
    pub(crate) fn tensors(&self) -> [Option<Tensor<1>>; 2] {
        [
            Some(self.prior.val()),
            self.residual.as_ref().map(Param::val),
        ]
    }

    /// The same model with other learnable numbers where some are given.
    pub(crate) fn with_tensors(&self, tensors: [Option<Tensor<1>>; 2]) -> Self {
        let [prior, residual] = tensors;
        let prior = prior.map(|tensor| learnable(PRIOR_ID, tensor));
        let residual = residual.map(|tensor| learnable(RESIDUAL_ID, tensor));
        Self {
            prior: prior.unwrap_or_else(|| self.prior.clone()),
            residual: residual.or_else(|| self.residual.clone()),
            frame: self.frame.clone(),
        }
    }
}

impl<'m> Prepared<'m> {
    /// Models of `frame` with the learnable numbers `[models, numbers]` of prior and residual, where they have any. Each evaluates `rows` rows,
    /// one model's after the other's; a single model takes any number where `rows` is 1.
    pub(super) fn new(
        frame: &'m Frame,
        rows: usize,
        [prior, residual]: [Option<Tensor<2>>; 2],
    ) -> Self {
        let network = |(made, numbers)| Mlp::new(made, &numbers);
        let parameters = |prior| equations::columns(frame.parameters(), prior, rows);
        Self {
            frame,
            prior: frame.prior().zip(prior.clone()).map(network),
            residual: frame.residual().zip(residual).map(network),
            parameters: prior.map_or_else(Vec::new, parameters),
        }
    }

    /// ds/dt for columns of shape `[batch]`: `2n` states, `n` inputs held, time in seconds.
    pub fn flow(&self, state: &[Tensor<1>], input: &[Tensor<1>], time: &Tensor<1>) -> Flow {
        let (q, qd) = state.split_at(self.frame.joints);
        let mut rates = match (&self.frame.equations, &self.prior) {
            (Some(equations), _) => {
                let mut inputs = state.to_vec();
                inputs.extend_from_slice(input);
                inputs.push(time.clone());
                inputs.extend_from_slice(&self.parameters);
                equations.program.replay(&inputs)
            }
            (None, prior) => {
                let mlp = prior.as_ref().expect("a prior is equations or a network");
                let outputs = columns(mlp.forward(q, qd, input));
                match mlp.on() {
                    ResidualOn::Accelerations => qd.iter().cloned().chain(outputs).collect(),
                    ResidualOn::Derivative => outputs,
                }
            }
        };
        let mlp = self.residual.as_ref();
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

/// A vector as so many equal rows of a matrix; none of an empty vector, since Burn has no empty matrices.
pub(super) fn rows_of(vector: Tensor<1>, rows: usize) -> Option<Tensor<2>> {
    let width = vector.dims()[0];
    (width > 0).then(|| vector.expand([rows, width]))
}

fn learnable(id: u64, tensor: Tensor<1>) -> Param<Tensor<1>> {
    Param::initialized(ParamId::from(id), tensor.require_grad())
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
