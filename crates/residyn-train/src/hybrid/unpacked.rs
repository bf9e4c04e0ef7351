use burn::tensor::Tensor;

use super::tensor::columns;
use super::{HybridModel, Mlp, replay};
use residyn_core::model::ResidualOn;

/// ds/dt at a batch of points.
#[derive(Debug, Clone)]
pub struct Derivative {
    /// dq/dt, dqd/dt, then the rates of internal states: columns of shape `[batch]`, or `[1]` if all rows agree.
    pub rates: Vec<Tensor<1>>,
    /// F_r, `[batch, n or 2n]`; none in a model without a residual.
    pub residual: Option<Tensor<2>>,
}

/// A model with its physical parameters unpacked for the evaluations of one loss.
#[derive(Debug)]
pub struct Unpacked<'m> {
    model: &'m HybridModel,
    parameters: Vec<Tensor<1>>,
}

impl<'m> Unpacked<'m> {
    pub(super) fn new(model: &'m HybridModel) -> Self {
        let parameters = model.physics.as_ref().map(|physics| physics.columns());
        Self {
            model,
            parameters: parameters.unwrap_or_default(),
        }
    }

    /// ds/dt for columns of shape `[batch]`: states, `n` inputs held, time in seconds. The rates of internal states are means
    /// over a step that begins in a state and has a length in seconds, `begun`.
    pub fn derivative(
        &self,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
        begun: [&[Tensor<1>]; 2],
    ) -> Derivative {
        let mut rates = self.prior(state, input, time, begun);
        let joints = self.model.joints();
        let (q, qd) = state[..2 * joints].split_at(joints);
        let residual = self.model.residual.as_ref();
        let residual = residual.map(|mlp| mlp.forward(q, qd, input));
        if let Some(residual) = residual.clone() {
            let parts = columns(residual);
            let first = 2 * joints - parts.len();
            for (rate, part) in rates[first..].iter_mut().zip(parts) {
                *rate = rate.clone() + part;
            }
        }
        Derivative { rates, residual }
    }

    /// The rates without the residual.
    fn prior(
        &self,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
        [start, length]: [&[Tensor<1>]; 2],
    ) -> Vec<Tensor<1>> {
        match (&self.model.structure().equations, &self.model.prior) {
            (Some(equations), _) => {
                let mut inputs = state.to_vec();
                inputs.extend_from_slice(input);
                inputs.push(time.clone());
                let internal = equations.layout().internal();
                if !internal.is_empty() {
                    inputs.extend_from_slice(&start[internal]);
                    inputs.extend_from_slice(length);
                }
                inputs.extend_from_slice(&self.parameters);
                replay(&equations.program, &inputs)
            }
            (None, prior) => {
                let (q, qd) = state.split_at(self.model.joints());
                let mlp: &Mlp = prior.as_ref().expect("a prior is equations or a network");
                let outputs = columns(mlp.forward(q, qd, input));
                match mlp.on() {
                    ResidualOn::Accelerations => qd.iter().cloned().chain(outputs).collect(),
                    ResidualOn::Derivative => outputs,
                }
            }
        }
    }
}
