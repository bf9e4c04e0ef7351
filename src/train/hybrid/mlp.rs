use burn::tensor::{Tensor, activation::relu};

use super::tensor::tensor;
use crate::model::{Angles, MlpWeights, ResidualOn};

/// Multilayer perceptrons of one shape with ReLU on every layer but the last, unpacked for Burn's operations. Each
/// evaluates its own rows, one network's after the other's.
#[derive(Debug)]
pub(super) struct Mlp<'m> {
    made: &'m MlpWeights,
    /// `[1, features]`
    mean: Tensor<2>,
    /// 1 / standard deviation, `[1, features]`
    factor: Tensor<2>,
    /// Weights `[network, input, output]` and biases `[network, 1, output]`.
    layers: Vec<[Tensor<3>; 2]>,
}

impl<'m> Mlp<'m> {
    /// The networks of the shape of `made` with the weights and biases `[network, number]`, in the order of
    /// [`MlpWeights::flat`].
    pub(super) fn new(made: &'m MlpWeights, numbers: &Tensor<2>) -> Self {
        let networks = numbers.dims()[0];
        let row = |values: &[f64]| tensor(values, [1, values.len()], &numbers.device());
        let factor: Vec<f64> = made.scaling.std.iter().map(|std| 1.0 / std).collect();
        let mut first = 0;
        let mut next = |rows: usize, columns: usize| {
            let part = numbers.clone().narrow(1, first, rows * columns);
            first += rows * columns;
            part.reshape([networks, rows, columns])
        };
        let layers = made.layers.iter().map(|layer| {
            let weight = next(layer.outputs, layer.inputs);
            [weight.swap_dims(1, 2), next(1, layer.outputs)]
        });
        Self {
            mean: row(&made.scaling.mean),
            factor: row(&factor),
            layers: layers.collect(),
            made,
        }
    }

    /// What the outputs are added to.
    pub(super) fn on(&self) -> ResidualOn {
        self.made.on
    }

    /// Outputs `[batch, n or 2n]` for columns `[batch]` of positions, velocities and inputs.
    pub(super) fn forward(
        &self,
        q: &[Tensor<1>],
        qd: &[Tensor<1>],
        tau: &[Tensor<1>],
    ) -> Tensor<2> {
        let positions: Vec<Tensor<1>> = match self.made.angles {
            Angles::Raw => q.to_vec(),
            Angles::SinCos => (q.iter().map(|q| q.clone().sin()))
                .chain(q.iter().map(|q| q.clone().cos()))
                .collect(),
        };
        let columns = positions.iter().chain(qd).chain(tau).cloned().collect();
        let features: Tensor<2> = Tensor::stack(columns, 1);
        let scaled = (features - self.mean.clone()) * self.factor.clone();
        let [batch, width] = scaled.dims();
        let networks = self.layers[0][0].dims()[0];
        let mut values = scaled.reshape([networks, batch / networks, width]);
        for (k, [weight, bias]) in self.layers.iter().enumerate() {
            values = values.matmul(weight.clone()) + bias.clone();
            if k + 1 < self.layers.len() {
                values = relu(values);
            }
        }
        let outputs = values.dims()[2];
        values.reshape([batch, outputs])
    }
}
