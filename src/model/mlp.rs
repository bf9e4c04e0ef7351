use burn::module::{Module, Param, ParamId};
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, TensorData, activation::relu};

use super::network::{Angles, InputScaling, LayerWeights, MlpWeights, ResidualOn};

/// A multilayer perceptron with ReLU on every layer but the last, as a Burn module.
#[derive(Module, Debug)]
pub struct Mlp {
    layers: Vec<Linear>,
    /// `[1, features]`
    mean: Tensor<2>,
    /// 1 / standard deviation, `[1, features]`
    factor: Tensor<2>,
    #[module(skip)]
    scaling: InputScaling,
    #[module(skip)]
    angles: Angles,
    #[module(skip)]
    on: ResidualOn,
}

impl Mlp {
    /// The network of these numbers, its parameters numbered from `first_id` on. Fixed numbers, unlike
    /// Burn's random ones, let an optimiser's saved state find its parameters again.
    pub(super) fn new(weights: &MlpWeights, first_id: u64, device: &Device) -> Self {
        let row = |values: Vec<f64>| {
            let width = values.len();
            Tensor::from_data(TensorData::new(to_f32(&values), [1, width]), device)
        };
        let layers = (weights.layers.iter().zip((first_id..).step_by(2)))
            .map(|(layer, id)| linear(layer, id, device))
            .collect();
        let factor = weights.scaling.std.iter().map(|std| 1.0 / std).collect();
        Self {
            layers,
            mean: row(weights.scaling.mean.clone()),
            factor: row(factor),
            scaling: weights.scaling.clone(),
            angles: weights.angles,
            on: weights.on,
        }
    }

    /// What the outputs are added to.
    pub fn on(&self) -> ResidualOn {
        self.on
    }

    /// Outputs `[batch, n or 2n]` for columns `[batch]` of positions, velocities and inputs.
    pub fn forward(&self, q: &[Tensor<1>], qd: &[Tensor<1>], tau: &[Tensor<1>]) -> Tensor<2> {
        let positions: Vec<Tensor<1>> = match self.angles {
            Angles::Raw => q.to_vec(),
            Angles::SinCos => (q.iter().map(|q| q.clone().sin()))
                .chain(q.iter().map(|q| q.clone().cos()))
                .collect(),
        };
        let columns = positions.iter().chain(qd).chain(tau).cloned().collect();
        let features: Tensor<2> = Tensor::stack(columns, 1);
        let mut values = (features - self.mean.clone()) * self.factor.clone();
        for (k, layer) in self.layers.iter().enumerate() {
            values = layer.forward(values);
            if k + 1 < self.layers.len() {
                values = relu(values);
            }
        }
        values
    }

    /// All numbers of the network.
    pub fn weights(&self) -> MlpWeights {
        MlpWeights {
            angles: self.angles,
            on: self.on,
            scaling: self.scaling.clone(),
            layers: self.layers.iter().map(layer_weights).collect(),
        }
    }

    /// The device that the network was made on.
    pub(super) fn device(&self) -> Device {
        self.mean.device()
    }

    /// The numbers by which an optimiser knows the parameters.
    pub(crate) fn ids(&self) -> Vec<ParamId> {
        (self.layers.iter())
            .flat_map(|layer| {
                [Some(layer.weight.id), layer.bias.as_ref().map(|b| b.id)]
                    .into_iter()
                    .flatten()
            })
            .collect()
    }
}

/// Burn keeps `[input, output]`, the plain numbers are `[output][input]`.
fn linear(layer: &LayerWeights, id: u64, device: &Device) -> Linear {
    let shape = [layer.outputs, layer.inputs];
    let stored: Tensor<2> =
        Tensor::from_data(TensorData::new(to_f32(&layer.weight), shape), device);
    // The transposed view is copied out, so that later steps read memory in order.
    let weight = Tensor::from_data(stored.transpose().into_data(), device).require_grad();
    let bias = Tensor::from_data(
        TensorData::new(to_f32(&layer.bias), [layer.outputs]),
        device,
    )
    .require_grad();
    Linear {
        weight: Param::initialized(ParamId::from(id), weight),
        bias: Some(Param::initialized(ParamId::from(id + 1), bias)),
    }
}

fn layer_weights(layer: &Linear) -> LayerWeights {
    let [inputs, outputs] = layer.weight.dims();
    LayerWeights {
        inputs,
        outputs,
        weight: to_f64(layer.weight.val().transpose()),
        bias: layer
            .bias
            .as_ref()
            .map_or_else(Vec::new, |bias| to_f64(bias.val())),
    }
}

#[allow(clippy::cast_possible_truncation)] // training runs in f32
pub(super) fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| *value as f32).collect()
}

/// The entries of a tensor, row after row.
pub(super) fn to_f64<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter::<f32>().map(f64::from).collect()
}
