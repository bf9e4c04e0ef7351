use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData, activation::relu};

use super::network::{Angles, MlpWeights, ResidualOn};

/// A multilayer perceptron with ReLU on every layer but the last, as a Burn module.
#[derive(Module, Debug)]
pub struct Mlp {
    /// All weights and biases, see [`MlpWeights::flat`]: an optimiser's step costs by the tensor.
    flat: Param<Tensor<1>>,
    /// `[1, features]`
    mean: Tensor<2>,
    /// 1 / standard deviation, `[1, features]`
    factor: Tensor<2>,
    /// The network as it was made.
    #[module(skip)]
    made: Arc<MlpWeights>,
}

impl Mlp {
    /// The network of these numbers. A fixed `id`, unlike Burn's random ones, lets an optimiser's saved state find
    /// its parameters again.
    pub(super) fn new(weights: &MlpWeights, id: u64, device: &Device) -> Self {
        let row = |values: Vec<f64>| {
            let width = values.len();
            Tensor::from_data(TensorData::new(to_f32(&values), [1, width]), device)
        };
        let flat = to_f32(&weights.flat());
        let shape = [flat.len()];
        let flat = Tensor::from_data(TensorData::new(flat, shape), device).require_grad();
        let factor = weights.scaling.std.iter().map(|std| 1.0 / std).collect();
        Self {
            flat: Param::initialized(ParamId::from(id), flat),
            mean: row(weights.scaling.mean.clone()),
            factor: row(factor),
            made: Arc::new(weights.clone()),
        }
    }

    /// What the outputs are added to.
    pub fn on(&self) -> ResidualOn {
        self.made.on
    }

    /// All weights and biases, see [`MlpWeights::flat`].
    pub(super) fn flat(&self) -> Tensor<1> {
        self.flat.val()
    }

    /// The network as it was made: its shape and scaling, not its present numbers.
    pub(super) fn made(&self) -> &Arc<MlpWeights> {
        &self.made
    }

    /// Outputs `[batch, n or 2n]` for columns `[batch]` of positions, velocities and inputs.
    pub fn forward(&self, q: &[Tensor<1>], qd: &[Tensor<1>], tau: &[Tensor<1>]) -> Tensor<2> {
        let positions: Vec<Tensor<1>> = match self.made.angles {
            Angles::Raw => q.to_vec(),
            Angles::SinCos => (q.iter().map(|q| q.clone().sin()))
                .chain(q.iter().map(|q| q.clone().cos()))
                .collect(),
        };
        let columns = positions.iter().chain(qd).chain(tau).cloned().collect();
        let features: Tensor<2> = Tensor::stack(columns, 1);
        let mut values = (features - self.mean.clone()) * self.factor.clone();
        let flat = self.flat();
        let mut first = 0;
        for (k, layer) in self.made.layers.iter().enumerate() {
            let (inputs, outputs) = (layer.inputs, layer.outputs);
            let weight = flat.clone().narrow(0, first, inputs * outputs);
            let bias = flat.clone().narrow(0, first + inputs * outputs, outputs);
            first += layer.numbers();
            let weight = weight.reshape([outputs, inputs]).transpose();
            values = values.matmul(weight) + bias.reshape([1, outputs]);
            if k + 1 < self.made.layers.len() {
                values = relu(values);
            }
        }
        values
    }

    /// All numbers of the network.
    pub fn weights(&self) -> MlpWeights {
        self.made.with_flat(&to_f64(self.flat()))
    }

    /// The device that the network was made on.
    pub(super) fn device(&self) -> Device {
        self.mean.device()
    }

    /// The number by which an optimiser knows the parameters.
    pub(super) fn id(&self) -> ParamId {
        self.flat.id
    }
}

#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(crate) fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| *value as f32).collect()
}

/// The entries of a tensor, row after row.
pub(super) fn to_f64<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter::<f32>().map(f64::from).collect()
}
