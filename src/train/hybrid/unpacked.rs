use burn::tensor::Tensor;

use super::mlp::Mlp;
use super::tensor::columns;
use super::{Structure, equations, replay};
use crate::model::ResidualOn;

/// ds/dt at a batch of points.
#[derive(Debug, Clone)]
pub struct Derivative {
    /// dq/dt then dqd/dt: `2n` columns of shape `[batch]`, or `[1]` where all rows agree.
    pub rates: Vec<Tensor<1>>,
    /// F_r, `[batch, n or 2n]`; none in a model without a residual.
    pub residual: Option<Tensor<2>>,
}

/// A model, or several of one structure, with its learnable numbers unpacked for the evaluations of one loss.
#[derive(Debug)]
pub struct Unpacked<'m> {
    structure: &'m Structure,
    parameters: Vec<Tensor<1>>,
    prior: Option<Mlp<'m>>,
    residual: Option<Mlp<'m>>,
}

impl<'m> Unpacked<'m> {
    /// Models of `structure` with the learnable numbers `[models, numbers]` of prior and residual, where they have any.
    /// Each evaluates `rows` rows, one model's after the other's; a single model takes any number where `rows` is 1.
    pub(in crate::train) fn new(
        structure: &'m Structure,
        rows: usize,
        [prior, residual]: [Option<Tensor<2>>; 2],
    ) -> Self {
        let network = |(made, numbers)| Mlp::new(made, &numbers);
        let parameters = |prior| equations::columns(structure.parameters(), prior, rows);
        Self {
            structure,
            prior: structure.prior().zip(prior.clone()).map(network),
            residual: structure.residual().zip(residual).map(network),
            parameters: prior.map_or_else(Vec::new, parameters),
        }
    }

    /// ds/dt for columns of shape `[batch]`: `2n` states, `n` inputs held, time in seconds.
    pub fn derivative(
        &self,
        state: &[Tensor<1>],
        input: &[Tensor<1>],
        time: &Tensor<1>,
    ) -> Derivative {
        let (q, qd) = state.split_at(self.structure.joints);
        let mut rates = match (&self.structure.equations, &self.prior) {
            (Some(equations), _) => {
                let mut inputs = state.to_vec();
                inputs.extend_from_slice(input);
                inputs.push(time.clone());
                inputs.extend_from_slice(&self.parameters);
                replay(&equations.program, &inputs)
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
        Derivative { rates, residual }
    }
}
