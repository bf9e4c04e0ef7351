use std::sync::Arc;

use burn::backend::DispatchTensor;
use burn::module::{Module, Param, ParamId};
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, TensorData, activation::relu};

use super::tensor::{Views, tensor, to_f32, vector};
use residyn_core::model::{Angles, LayerWeights, MlpWeights, ResidualOn, to_f32 as rounded};

/// A multilayer perceptron of positions, velocities and inputs, with ReLU on every layer but the last.
#[derive(Module, Debug)]
pub struct Mlp {
    pub layers: Vec<Linear>,
    /// The initial definition of the layers: their shapes, the features and their scaling.
    #[module(skip)]
    made: Arc<MlpWeights>,
}

impl Mlp {
    /// The network with these weights; its tensors are numbered from `first`.
    pub(super) fn new(made: &MlpWeights, first: u64, device: &Device) -> Self {
        let ids = (first..).step_by(2);
        let layers = made.layers.iter().zip(ids);
        Self {
            layers: layers
                .map(|(layer, id)| linear(layer, id, device))
                .collect(),
            made: Arc::new(made.clone()),
        }
    }

    /// The current weights.
    pub(super) fn weights(&self) -> MlpWeights {
        let mut weights = (*self.made).clone();
        for (to, layer) in weights.layers.iter_mut().zip(&self.layers) {
            let f64s = |values: Vec<f32>| values.into_iter().map(f64::from).collect();
            to.weight = f64s(to_f32(layer.weight.val().transpose()));
            to.bias = f64s(to_f32(bias(layer).val()));
        }
        weights
    }

    /// The network with the next numbers of these views: layer after layer, the weights `[input][output]` before the
    /// biases.
    pub(super) fn with_numbers(&self, views: &mut Views<'_>) -> Self {
        let layers = self.layers.iter().map(|layer| {
            let [inputs, outputs] = layer.weight.dims();
            let weight = views.next(inputs * outputs).reshape([inputs, outputs]);
            Linear {
                weight: Param::initialized(layer.weight.id, weight),
                bias: Some(Param::initialized(bias(layer).id, views.next(outputs))),
            }
        });
        Self {
            layers: layers.collect(),
            made: self.made.clone(),
        }
    }

    /// All tensors, each layer's weights before its biases.
    pub(super) fn tensors(&self) -> impl Iterator<Item = DispatchTensor> {
        self.layers.iter().flat_map(|layer| {
            let (weight, bias) = (layer.weight.val(), bias(layer).val());
            [weight.into_dispatch(), bias.into_dispatch()]
        })
    }

    /// What the outputs are added to.
    pub(super) fn on(&self) -> ResidualOn {
        self.made.on
    }

    /// Outputs `[batch, n or 2n]` for columns `[batch]` of positions, velocities and inputs.
    pub fn forward(&self, q: &[Tensor<1>], qd: &[Tensor<1>], tau: &[Tensor<1>]) -> Tensor<2> {
        let mut values = self.features(q, qd, tau);
        for (k, layer) in self.layers.iter().enumerate() {
            values = layer.forward(values);
            if k + 1 < self.layers.len() {
                values = relu(values);
            }
        }
        values
    }

    /// The scaled features, `[batch, features]`.
    fn features(&self, q: &[Tensor<1>], qd: &[Tensor<1>], tau: &[Tensor<1>]) -> Tensor<2> {
        let positions: Vec<Tensor<1>> = match self.made.angles {
            Angles::Raw => q.to_vec(),
            Angles::SinCos => (q.iter().map(|q| q.clone().sin()))
                .chain(q.iter().map(|q| q.clone().cos()))
                .collect(),
        };
        let columns = positions.iter().chain(qd).chain(tau).cloned().collect();
        let features: Tensor<2> = Tensor::stack(columns, 1);
        let row = |values: &[f64]| vector(values, &features.device()).unsqueeze::<2>();
        let factor: Vec<f64> = self.made.scaling.std.iter().map(|std| 1.0 / std).collect();
        let (mean, factor) = (row(&self.made.scaling.mean), row(&factor));
        (features - mean) * factor
    }
}

/// The bias of a layer, which all layers of a perceptron have.
fn bias(layer: &Linear) -> &Param<Tensor<1>> {
    layer.bias.as_ref().expect("every layer has a bias")
}

/// A layer with these weights; Burn stores weights as `[input, output]`.
fn linear(layer: &LayerWeights, id: u64, device: &Device) -> Linear {
    let shape = [layer.outputs, layer.inputs];
    let weight = tensor(&layer.weight, shape, &device.clone().without_autodiff());
    let weight = Tensor::<2>::from_data(weight.transpose().into_data(), device);
    let bias = TensorData::new(rounded(&layer.bias), [layer.outputs]);
    let bias = Tensor::<1>::from_data(bias, device);
    Linear {
        weight: Param::initialized(ParamId::from(id), weight.require_grad()),
        bias: Some(Param::initialized(
            ParamId::from(id + 1),
            bias.require_grad(),
        )),
    }
}
