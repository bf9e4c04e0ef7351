use rand::{Rng, RngExt};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

use crate::limits::{LAYER_WIDTH, NETWORK_NUMBERS};

/// How the joint positions enter a network. Applies to every joint, so a model with a sliding joint
/// takes [`Angles::Raw`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Angles {
    /// As they are, rad or m.
    #[default]
    Raw,
    /// As sine and cosine, so that a full turn changes nothing.
    SinCos,
}

/// What the outputs of a network are added to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResidualOn {
    /// n outputs, on dqd/dt: the missing part is a force, and positions stay integrals of velocities.
    #[default]
    Accelerations,
    /// 2n outputs, on dq/dt and dqd/dt: the form of the published method.
    Derivative,
}

/// How the last layer of a new network begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LastLayer {
    /// All zero: a residual starts at zero, and the model as its prior.
    Zero,
    /// Random like the others: for a network that is the whole model.
    Random,
}

/// The choices that make a network, as a user states them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MlpSettings {
    /// Neurons of each hidden layer; ReLU follows each of them.
    #[serde(deserialize_with = "hidden")]
    pub hidden: Vec<usize>,
    #[serde(default)]
    pub angles: Angles,
    #[serde(default)]
    pub on: ResidualOn,
}

/// Check the widths of hidden layers.
///
/// # Errors
/// A width or a number of weights outside its range, and that range.
pub(super) fn check_hidden(hidden: &[usize]) -> Result<(), String> {
    if hidden
        .iter()
        .any(|width| !(1..=LAYER_WIDTH).contains(width))
    {
        return Err(format!(
            "`hidden` must list layer widths: whole numbers from 1 to {LAYER_WIDTH}"
        ));
    }
    let numbers: usize = hidden.windows(2).map(|pair| pair[0] * pair[1]).sum();
    match numbers <= NETWORK_NUMBERS {
        true => Ok(()),
        false => Err(format!(
            "`hidden` makes {numbers} weights, and a network has at most {NETWORK_NUMBERS}"
        )),
    }
}

fn hidden<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<usize>, D::Error> {
    let hidden = Vec::deserialize(from)?;
    check_hidden(&hidden).map_err(D::Error::custom)?;
    Ok(hidden)
}

impl MlpSettings {
    /// The published sizes: 16 neurons per layer, 3 layers for one joint, 4 for more.
    pub fn for_joints(joints: usize) -> Self {
        Self {
            hidden: vec![16; if joints == 1 { 3 } else { 4 }],
            angles: Angles::default(),
            on: ResidualOn::default(),
        }
    }
}

impl Angles {
    /// Number of features that `joints` joints make: positions, velocities, inputs.
    pub fn features(self, joints: usize) -> usize {
        match self {
            Self::Raw => 3 * joints,
            Self::SinCos => 4 * joints,
        }
    }

    /// The features of one row, in the order of a network's inputs.
    pub fn row(self, q: &[f64], qd: &[f64], tau: &[f64]) -> Vec<f64> {
        let mut row: Vec<f64> = match self {
            Self::Raw => q.to_vec(),
            Self::SinCos => (q.iter().map(|x| x.sin()))
                .chain(q.iter().map(|x| x.cos()))
                .collect(),
        };
        row.extend(qd.iter().chain(tau));
        row
    }
}

impl ResidualOn {
    /// Number of outputs for `joints` joints.
    pub fn outputs(self, joints: usize) -> usize {
        match self {
            Self::Accelerations => joints,
            Self::Derivative => 2 * joints,
        }
    }
}

/// Mean and standard deviation by which each feature is scaled to order one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputScaling {
    pub mean: Vec<f64>,
    /// Never zero.
    pub std: Vec<f64>,
}

/// A network that does not fit a model's joints.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "a network with layer widths {widths:?} does not fit {joints} joints: it must begin with \
     {features} features, end with {outputs} outputs and have no empty layer; change `hidden`, \
     or use the network that was trained for this system"
)]
pub struct NetworkError {
    pub joints: usize,
    pub features: usize,
    pub outputs: usize,
    pub widths: Vec<usize>,
}

impl InputScaling {
    /// Features enter as they are.
    pub fn identity(features: usize) -> Self {
        Self {
            mean: vec![0.0; features],
            std: vec![1.0; features],
        }
    }

    /// Measured on rows of features. A feature that never changes keeps the factor 1.
    pub fn from_rows(features: usize, rows: impl Iterator<Item = Vec<f64>> + Clone) -> Self {
        let count = rows.clone().count().max(1) as f64;
        let mut mean = vec![0.0; features];
        for row in rows.clone() {
            for (sum, x) in mean.iter_mut().zip(&row) {
                *sum += x / count;
            }
        }
        let mut variance = vec![0.0; features];
        for row in rows {
            for ((sum, x), mean) in variance.iter_mut().zip(&row).zip(&mean) {
                *sum += (x - mean).powi(2) / count;
            }
        }
        let std = (variance.iter().zip(&mean))
            .map(|(v, mean)| match v.sqrt() {
                // A spread below this is rounding of the sums.
                std if std > 1e-9 * (1.0 + mean.abs()) => std,
                _ => 1.0,
            })
            .collect();
        Self { mean, std }
    }
}

/// One layer as plain numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerWeights {
    pub inputs: usize,
    pub outputs: usize,
    /// `[output][input]`, row after row, as PyTorch stores a linear layer.
    pub weight: Vec<f64>,
    pub bias: Vec<f64>,
}

/// A network as plain numbers: what is saved, exported, and written into programs.
/// Every number is exactly an f32.
#[derive(Debug, Clone, PartialEq)]
pub struct MlpWeights {
    pub angles: Angles,
    pub on: ResidualOn,
    pub scaling: InputScaling,
    pub layers: Vec<LayerWeights>,
}

impl MlpWeights {
    /// A new network. Weights and biases are uniform within 1/sqrt(inputs of the layer), which is what
    /// Burn's and PyTorch's linear layers do; drawn here so that all backends begin alike.
    pub fn new(
        joints: usize,
        settings: &MlpSettings,
        scaling: InputScaling,
        last: LastLayer,
        rng: &mut impl Rng,
    ) -> Self {
        let mut widths = vec![settings.angles.features(joints)];
        widths.extend(&settings.hidden);
        widths.push(settings.on.outputs(joints));
        Self {
            angles: settings.angles,
            on: settings.on,
            scaling,
            layers: layers(&widths, last, rng),
        }
    }

    /// A new network of the same shape and scaling, as [`MlpWeights::new`] draws it.
    #[must_use]
    pub fn redrawn(&self, last: LastLayer, rng: &mut impl Rng) -> Self {
        Self {
            layers: layers(&self.widths(), last, rng),
            ..self.clone()
        }
    }

    /// The same function with its features scaled differently, for data of another spread: the first layer absorbs the
    /// difference.
    ///
    /// # Panics
    /// When `scaling` has another number of features.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // every number is an f32
    pub fn rescaled(&self, scaling: InputScaling) -> Self {
        let old = &self.scaling;
        assert_eq!(scaling.mean.len(), old.mean.len(), "the same features");
        let mut network = self.clone();
        let first = &mut network.layers[0];
        for (weights, bias) in first.weight.chunks_mut(first.inputs).zip(&mut first.bias) {
            for (k, weight) in weights.iter_mut().enumerate() {
                *bias += *weight * (scaling.mean[k] - old.mean[k]) / old.std[k];
                *weight = f64::from((*weight * scaling.std[k] / old.std[k]) as f32);
            }
            *bias = f64::from(*bias as f32);
        }
        network.scaling = scaling;
        network
    }

    /// Widths from the features to the outputs.
    pub fn widths(&self) -> Vec<usize> {
        let first = self.layers.first().map(|layer| layer.inputs);
        let outputs = self.layers.iter().map(|layer| layer.outputs);
        first.into_iter().chain(outputs).collect()
    }

    /// All weights and biases as one list: layer after layer, the weights `[output][input]` before the biases.
    pub fn flat(&self) -> Vec<f64> {
        let layers = self.layers.iter();
        layers
            .flat_map(|layer| layer.weight.iter().chain(&layer.bias).copied())
            .collect()
    }

    /// The same network with other weights and biases, in the order of [`MlpWeights::flat`].
    ///
    /// # Panics
    /// When there are fewer numbers than the network has.
    #[must_use]
    pub fn with_flat(&self, flat: &[f64]) -> Self {
        let mut network = self.clone();
        let mut rest = flat;
        for layer in &mut network.layers {
            let (weight, after) = rest.split_at(layer.weight.len());
            let (bias, after) = after.split_at(layer.bias.len());
            layer.weight.copy_from_slice(weight);
            layer.bias.copy_from_slice(bias);
            rest = after;
        }
        network
    }

    /// Check that the network fits a system of `joints` joints.
    ///
    /// # Errors
    /// When widths do not follow from each other, from the joints or from the scaling.
    pub fn check(&self, joints: usize) -> Result<(), NetworkError> {
        let (features, outputs) = (self.angles.features(joints), self.on.outputs(joints));
        let widths = self.widths();
        let chained = self
            .layers
            .windows(2)
            .all(|pair| pair[0].outputs == pair[1].inputs);
        let full = self.layers.iter().all(|layer| {
            layer.weight.len() == layer.inputs * layer.outputs && layer.bias.len() == layer.outputs
        });
        let ends = widths.first() == Some(&features) && widths.last() == Some(&outputs);
        let scaled = self.scaling.mean.len() == features && self.scaling.std.len() == features;
        if chained && full && ends && scaled && !widths.contains(&0) {
            Ok(())
        } else {
            Err(NetworkError {
                joints,
                features,
                outputs,
                widths,
            })
        }
    }
}

fn layers(widths: &[usize], last: LastLayer, rng: &mut impl Rng) -> Vec<LayerWeights> {
    let count = widths.len() - 1;
    (widths.windows(2).enumerate())
        .map(|(k, pair)| match last {
            LastLayer::Zero if k + 1 == count => LayerWeights::zero(pair[0], pair[1]),
            _ => LayerWeights::random(pair[0], pair[1], rng),
        })
        .collect()
}

impl LayerWeights {
    /// How many weights and biases it has.
    pub fn numbers(&self) -> usize {
        self.outputs * (self.inputs + 1)
    }

    pub(super) fn new(inputs: usize, weight: Vec<f64>, bias: Vec<f64>) -> Self {
        Self {
            inputs,
            outputs: bias.len(),
            weight,
            bias,
        }
    }

    pub(super) fn zero(inputs: usize, outputs: usize) -> Self {
        Self::new(inputs, vec![0.0; inputs * outputs], vec![0.0; outputs])
    }

    fn random(inputs: usize, outputs: usize, rng: &mut impl Rng) -> Self {
        #[allow(clippy::cast_possible_truncation)] // weights are f32 wherever they are trained
        let bound = (1.0 / (inputs as f64).sqrt()) as f32;
        let mut draw = |count: usize| -> Vec<f64> {
            (0..count)
                .map(|_| f64::from(rng.random_range(-bound..=bound)))
                .collect()
        };
        let weight = draw(inputs * outputs);
        Self::new(inputs, weight, draw(outputs))
    }
}

/// In the precision of training and of planners.
#[allow(clippy::cast_possible_truncation)]
pub fn to_f32(values: &[f64]) -> Vec<f32> {
    values.iter().map(|value| *value as f32).collect()
}
