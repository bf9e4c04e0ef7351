use pulp::Simd;

use super::network::{Layer, Network};
use super::product::{Finish, Product};
use super::{Rows, W};
use crate::lanes::{Element, Vector};

/// A range of the values of several blocks of rows.
#[derive(Clone, Copy)]
struct Columns<'a> {
    rows: &'a [Rows],
    /// Values of one block.
    stride: usize,
    first: usize,
}

impl<'a> Columns<'a> {
    #[inline(always)]
    fn registers<S: Simd, const N: usize>(
        self,
        block: usize,
        from: usize,
    ) -> [&'a [<f32 as Element>::Register<S>]; N] {
        let rows = &self.rows[block * self.stride + self.first + from..][..N];
        std::array::from_fn(|k| f32::registers::<S>(&rows[k].0))
    }
}

/// The derivatives by a network's numbers as they add up, lane by lane: one register a number.
#[derive(Debug, Default)]
pub struct GradientSums {
    /// Left over from an earlier sum where `is_zero`.
    lanes: Vec<f32>,
    is_zero: bool,
}

impl GradientSums {
    /// Sets the sums for so many numbers to zero. The first gradient overwrites the memory, which is not cleared: that took a
    /// tenth of an epoch on 500 transitions.
    pub fn clear<S: Simd>(&mut self, numbers: usize) {
        self.lanes.resize(numbers * f32::lanes::<S>(), 0.0);
        self.is_zero = true;
    }

    /// The sums, a register a number.
    pub fn registers<S: Simd>(&mut self) -> &[<f32 as Element>::Register<S>] {
        if self.is_zero {
            self.lanes.fill(0.0);
            self.is_zero = false;
        }
        f32::registers::<S>(&self.lanes)
    }
}

impl Network {
    /// Backpropagation for several blocks of rows. `activations` are those of [`Network::forward`], with the loss
    /// gradient with respect to the outputs in place of the outputs; every layer's values are replaced by the
    /// gradient with respect to the inputs of its ReLU.
    ///
    /// The gradient is added to `sums`. `by_features`, unless it is empty, receives the gradient with respect to the
    /// features.
    #[inline(always)]
    pub fn backward<S: Simd>(
        &self,
        simd: S,
        features: &[Rows],
        activations: &mut [Rows],
        by_features: &mut [Rows],
        sums: &mut GradientSums,
    ) {
        let stride = self.activations();
        let blocks = activations.len() / stride;
        for (k, layer) in self.layers.iter().enumerate().rev() {
            let inputs = match k {
                0 => Columns {
                    rows: features,
                    stride: layer.inputs,
                    first: 0,
                },
                _ => Columns {
                    rows: activations,
                    stride,
                    first: self.layers[k - 1].values.start,
                },
            };
            let slopes = Columns {
                rows: activations,
                stride,
                first: layer.values.start,
            };
            layer.add_gradient(simd, blocks, slopes, inputs, sums);
            for block in 0..blocks {
                let values = &mut activations[block * stride..][..stride];
                let (before, slopes) = values.split_at_mut(layer.values.start);
                let (finish, to) = match k {
                    0 if by_features.is_empty() => continue,
                    0 => {
                        let to = &mut by_features[block * layer.inputs..];
                        (Finish::Plain, &mut to[..layer.inputs])
                    }
                    _ => {
                        let first = before.len() - layer.inputs;
                        (Finish::Masked, &mut before[first..])
                    }
                };
                let product = Product {
                    weight: &self.numbers[layer.weight.clone()],
                    bias: &[],
                    finish,
                };
                product.run(simd, &slopes[..layer.outputs], to);
            }
        }
        sums.is_zero = false;
    }
}

/// The sums of a layer's weights.
struct Weights<'s, S: Simd> {
    registers: &'s mut [<f32 as Element>::Register<S>],
    /// Whether the sums are zero, whatever the registers hold.
    is_zero: bool,
}

impl Layer {
    /// Accumulate the gradient of the layer's weights and biases.
    #[inline(always)]
    fn add_gradient<S: Simd>(
        &self,
        simd: S,
        blocks: usize,
        slopes: Columns,
        inputs: Columns,
        sums: &mut GradientSums,
    ) {
        let lanes = f32::lanes::<S>();
        let is_zero = sums.is_zero;
        let own = &mut sums.lanes[lanes * self.weight.start..lanes * self.bias.end];
        let (weight, bias) = f32::registers_mut::<S>(own).split_at_mut(self.weight.len());
        let mut weight = Weights::<S> {
            registers: weight,
            is_zero,
        };
        let mut output = 0;
        while self.outputs - output >= 4 {
            self.row_of_tiles::<S, 4>(simd, output, blocks, slopes, inputs, &mut weight);
            output += 4;
        }
        while self.outputs > output {
            self.row_of_tiles::<S, 1>(simd, output, blocks, slopes, inputs, &mut weight);
            output += 1;
        }
        for (output, bias) in bias.iter_mut().enumerate() {
            let mut sum = match is_zero {
                true => Vector::<S, f32>::splat(simd, 0.0),
                false => Vector::new(simd, *bias),
            };
            for block in 0..blocks {
                let [slopes] = slopes.registers::<S, 1>(block, output);
                for slope in slopes {
                    sum = sum + Vector::new(simd, *slope);
                }
            }
            *bias = sum.register;
        }
    }

    /// The weight gradient of `O` outputs.
    #[inline(always)]
    fn row_of_tiles<S: Simd, const O: usize>(
        &self,
        simd: S,
        output: usize,
        blocks: usize,
        slopes: Columns,
        inputs: Columns,
        weight: &mut Weights<S>,
    ) {
        let mut input = 0;
        if S::REGISTER_COUNT >= 32 {
            while self.inputs - input >= 4 {
                self.tile::<S, O, 4>(simd, (output, input), blocks, slopes, inputs, weight);
                input += 4;
            }
        }
        while self.inputs - input >= 2 {
            self.tile::<S, O, 2>(simd, (output, input), blocks, slopes, inputs, weight);
            input += 2;
        }
        while self.inputs > input {
            self.tile::<S, O, 1>(simd, (output, input), blocks, slopes, inputs, weight);
            input += 1;
        }
    }

    /// `O` outputs by `I` inputs, accumulated in registers over all rows.
    #[inline(always)]
    fn tile<S: Simd, const O: usize, const I: usize>(
        &self,
        simd: S,
        (output, input): (usize, usize),
        blocks: usize,
        slopes: Columns,
        inputs: Columns,
        weight: &mut Weights<S>,
    ) {
        let at = |o: usize| (output + o) * self.inputs + input;
        let mut sums = [[Vector::<S, f32>::splat(simd, 0.0); I]; O];
        if !weight.is_zero {
            for o in 0..O {
                let weight = &weight.registers[at(o)..][..I];
                for i in 0..I {
                    sums[o][i].register = weight[i];
                }
            }
        }
        for block in 0..blocks {
            let slopes = slopes.registers::<S, O>(block, output);
            let inputs = inputs.registers::<S, I>(block, input);
            for k in 0..W / f32::lanes::<S>() {
                for o in 0..O {
                    let slope = Vector::new(simd, slopes[o][k]);
                    for i in 0..I {
                        let input = Vector::new(simd, inputs[i][k]);
                        sums[o][i] = slope.mul_add(input, sums[o][i]);
                    }
                }
            }
        }
        for o in 0..O {
            let weight = &mut weight.registers[at(o)..][..I];
            for i in 0..I {
                weight[i] = sums[o][i].register;
            }
        }
    }
}
