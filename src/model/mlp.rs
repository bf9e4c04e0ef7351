use burn::tensor::{Device, Tensor, TensorData, activation::relu};

use super::network::{Angles, MlpWeights, ResidualOn};

/// A multilayer perceptron with ReLU on every layer but the last, unpacked for Burn's operations.
#[derive(Debug)]
pub(super) struct Mlp<'m> {
    made: &'m MlpWeights,
    /// `[1, features]`
    mean: Tensor<2>,
    /// 1 / standard deviation, `[1, features]`
    factor: Tensor<2>,
    /// Weights `[input, output]` and biases `[1, output]`.
    layers: Vec<[Tensor<2>; 2]>,
}

impl<'m> Mlp<'m> {
    /// The network that was made as `made` and has the numbers `flat` now, in the order of [`MlpWeights::flat`].
    pub(super) fn new(made: &'m MlpWeights, flat: &Tensor<1>) -> Self {
        let row = |values: &[f64]| vector(values, &flat.device()).reshape([1, values.len()]);
        let factor: Vec<f64> = made.scaling.std.iter().map(|std| 1.0 / std).collect();
        let mut first = 0;
        let mut next = |rows: usize, columns: usize| {
            let part = flat.clone().narrow(0, first, rows * columns);
            first += rows * columns;
            part.reshape([rows, columns])
        };
        let layers = made.layers.iter().map(|layer| {
            let weight = next(layer.outputs, layer.inputs);
            [weight.transpose(), next(1, layer.outputs)]
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
        let mut values = (features - self.mean.clone()) * self.factor.clone();
        for (k, [weight, bias]) in self.layers.iter().enumerate() {
            values = values.matmul(weight.clone()) + bias.clone();
            if k + 1 < self.layers.len() {
                values = relu(values);
            }
        }
        values
    }
}

/// The weights and biases of a network as one tensor.
pub(super) fn flat(weights: &MlpWeights, device: &Device) -> Tensor<1> {
    vector(&weights.flat(), device)
}

fn vector(values: &[f64], device: &Device) -> Tensor<1> {
    Tensor::from_data(TensorData::new(to_f32(values), [values.len()]), device)
}

#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(crate) fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| *value as f32).collect()
}

/// The entries of a tensor, row after row.
pub(super) fn to_f64<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter::<f32>().map(f64::from).collect()
}
