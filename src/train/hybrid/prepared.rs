use burn::tensor::Tensor;

use super::mlp::Mlp;
use super::{Frame, equations, replay};
use crate::model::ResidualOn;

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

impl<'m> Prepared<'m> {
    /// Models of `frame` with the learnable numbers `[models, numbers]` of prior and residual, where they have any. Each evaluates `rows` rows,
    /// one model's after the other's; a single model takes any number where `rows` is 1.
    pub(in crate::train) fn new(
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
        Flow { rates, residual }
    }
}

/// A vector as so many equal rows of a matrix; none of an empty vector, since Burn has no empty matrices.
pub(super) fn rows_of(vector: Tensor<1>, rows: usize) -> Option<Tensor<2>> {
    let width = vector.dims()[0];
    (width > 0).then(|| vector.expand([rows, width]))
}

/// The columns of a matrix `[batch, width]`.
pub(super) fn columns(matrix: Tensor<2>) -> Vec<Tensor<1>> {
    let [batch, width] = matrix.dims();
    if width == 1 {
        return vec![matrix.reshape([batch])];
    }
    (0..width)
        .map(|k| matrix.clone().slice([0..batch, k..k + 1]).reshape([batch]))
        .collect()
}
