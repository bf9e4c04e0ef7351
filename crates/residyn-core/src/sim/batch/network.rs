use std::ops::Range;

use pulp::Simd;

use super::Rows;
use super::product::{Finish, Product};

/// Weights and biases of a multilayer perceptron, ReLU after every layer but the last, laid out for [`Rows`].
#[derive(Debug, Clone)]
pub struct Network {
    pub(super) layers: Vec<Layer>,
    /// Layer by layer, the weights `[output][input]` before the biases.
    pub(super) numbers: Vec<f32>,
    /// The weights alone, `[input][output]`.
    transposed: Vec<f32>,
}

/// Index ranges of a layer's numbers and values.
#[derive(Debug, Clone)]
pub(super) struct Layer {
    pub inputs: usize,
    pub outputs: usize,
    /// Among the numbers.
    pub weight: Range<usize>,
    pub bias: Range<usize>,
    /// Among the transposed weights.
    transposed: Range<usize>,
    /// Its outputs among the activations.
    pub values: Range<usize>,
}

impl Network {
    /// A network with these layer widths, from features to outputs. `numbers` are in the order of
    /// [`MlpWeights::flat`](crate::model::MlpWeights::flat).
    ///
    /// # Panics
    /// When the count of numbers does not match the widths.
    pub fn new(widths: &[usize], numbers: &[f32]) -> Self {
        let mut layers: Vec<Layer> = Vec::with_capacity(widths.len());
        let (mut number, mut turned, mut value) = (0, 0, 0);
        for pair in widths.windows(2) {
            let (inputs, outputs) = (pair[0], pair[1]);
            let weights = inputs * outputs;
            layers.push(Layer {
                inputs,
                outputs,
                weight: number..number + weights,
                bias: number + weights..number + weights + outputs,
                transposed: turned..turned + weights,
                values: value..value + outputs,
            });
            number += weights + outputs;
            turned += weights;
            value += outputs;
        }
        let mut network = Self {
            layers,
            numbers: vec![0.0; number],
            transposed: vec![0.0; turned],
        };
        network.set_numbers(numbers);
        network
    }

    /// Replace all weights and biases.
    ///
    /// # Panics
    /// When the count of numbers differs.
    pub fn set_numbers(&mut self, numbers: &[f32]) {
        self.numbers.copy_from_slice(numbers);
        for layer in &self.layers {
            let weight = &numbers[layer.weight.clone()];
            let transposed = &mut self.transposed[layer.transposed.clone()];
            transpose(weight, layer.inputs, transposed);
        }
    }

    /// Replace all weights and biases by `numbers` in another order: each layer's weights `[input][output]`, as Burn's
    /// linear layers store them.
    ///
    /// # Panics
    /// When the count of numbers differs.
    pub fn set_by_input(&mut self, numbers: &[f32]) {
        assert_eq!(numbers.len(), self.numbers.len(), "one for each number");
        for layer in &self.layers {
            let turned = &numbers[layer.weight.clone()];
            self.transposed[layer.transposed.clone()].copy_from_slice(turned);
            transpose(
                turned,
                layer.outputs,
                &mut self.numbers[layer.weight.clone()],
            );
            let biases = &numbers[layer.bias.clone()];
            self.numbers[layer.bias.clone()].copy_from_slice(biases);
        }
    }

    /// Append `numbers` in the order that [`Network::set_by_input`] takes them.
    pub fn append_by_input(&self, numbers: &[f32], to: &mut Vec<f32>) {
        let start = to.len();
        to.extend_from_slice(numbers);
        for layer in &self.layers {
            let turned = &mut to[start..][layer.weight.clone()];
            transpose(&numbers[layer.weight.clone()], layer.inputs, turned);
        }
    }

    /// Length of the activations of [`Network::forward`]: the outputs of all layers.
    pub fn activations(&self) -> usize {
        self.outputs().end
    }

    /// Indices of the network's outputs within the activations.
    pub fn outputs(&self) -> Range<usize> {
        let last = self.layers.last();
        last.map_or(0..0, |layer| layer.values.clone())
    }

    /// Number of weights and biases.
    pub fn numbers(&self) -> usize {
        self.numbers.len()
    }

    /// Number of features.
    pub fn features(&self) -> usize {
        self.layers.first().map_or(0, |layer| layer.inputs)
    }

    /// Compute the outputs of all layers, in order, from scaled features.
    #[inline(always)]
    pub fn forward<S: Simd>(&self, simd: S, features: &[Rows], activations: &mut [Rows]) {
        for (k, layer) in self.layers.iter().enumerate() {
            let (before, to) = activations.split_at_mut(layer.values.start);
            let from = match k {
                0 => features,
                _ => &before[before.len() - layer.inputs..],
            };
            let product = Product {
                weight: &self.transposed[layer.transposed.clone()],
                bias: &self.numbers[layer.bias.clone()],
                finish: if k + 1 < self.layers.len() {
                    Finish::Relu
                } else {
                    Finish::Plain
                },
            };
            product.run(simd, from, &mut to[..layer.outputs]);
        }
    }
}

/// The transpose of a row-major matrix with `columns` columns.
fn transpose(matrix: &[f32], columns: usize, to: &mut [f32]) {
    let rows = matrix.len() / columns;
    for (k, row) in matrix.chunks_exact(columns).enumerate() {
        for (to, from) in to[k..].iter_mut().step_by(rows).zip(row) {
            *to = *from;
        }
    }
}
