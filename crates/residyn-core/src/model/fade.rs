//! Networks whose output fades to zero away from the motion that they were trained on.

use nalgebra::{Cholesky, DMatrix};

use super::network::{LayerWeights, MlpWeights, to_f32};
use super::residual::{nothing_but, with_residual};

/// A feature that the others determine keeps this share of its own spread: sensors are not exact.
const LEAST_SPREAD: f64 = 0.1;

/// The motion that a network was trained on, as the range of each whitened feature: its residual in the linear
/// regression on the features before it, in units of that residual's spread (the Cholesky factor of their covariance).
/// A torque can thus be unusual at one angle and speed and usual at others.
struct Seen {
    /// `[whitened][feature]`, of scaled features.
    factors: DMatrix<f64>,
    /// `[lowest, highest]` of each.
    ranges: Vec<[f64; 2]>,
}

impl Seen {
    fn of(rows: &[Vec<f64>], scaled: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| scaled(row)).collect();
        let size = rows[0].len();
        #[allow(clippy::cast_precision_loss)] // a few thousand
        let all = DMatrix::from_fn(rows.len(), size, |row, k| {
            rows[row][k] / (rows.len() as f64).sqrt()
        });
        let spread = DMatrix::identity(size, size) * LEAST_SPREAD.powi(2);
        let factor = Cholesky::new(all.tr_mul(&all) + spread).expect("positive definite");
        let factors = (factor
            .l()
            .solve_lower_triangular(&DMatrix::identity(size, size)))
        .expect("a Cholesky factor has no zero on its diagonal");
        let range = |k: usize| {
            let along = rows.iter().map(|row| {
                let parts = row.iter().enumerate();
                parts.map(|(i, value)| factors[(k, i)] * value).sum::<f64>()
            });
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            })
        };
        Self {
            ranges: (0..size).map(range).collect(),
            factors,
        }
    }

    /// How far each whitened feature is above its range, then how far below, before the ReLU.
    fn beyond(&self) -> LayerWeights {
        let size = self.ranges.len();
        let row = |k: usize, sign: f64| (0..size).map(move |i| sign * self.factors[(k, i)]);
        let above = (0..size).flat_map(|k| row(k, 1.0));
        let below = (0..size).flat_map(|k| row(k, -1.0));
        let bias = (self.ranges.iter().map(|[_, high]| -high))
            .chain(self.ranges.iter().map(|[low, _]| *low));
        LayerWeights::new(size, above.chain(below).collect(), bias.collect())
    }
}

impl MlpWeights {
    /// The same network on the motion that it was trained on, `rows` of positions, velocities and torques, and zero far
    /// from it: its outputs are limited to their largest magnitude there times max(0, 1 - d), where d is the distance
    /// from the range of the whitened features, summed over them. It is again a ReLU network, at least three layers
    /// deep, so that any code that evaluates networks evaluates this one:
    /// f limited to +-s is max(f + s, 0) - max(f - s, 0) - s, with the limit s = F max(0, 1 - d), and d is a sum of ReLUs.
    ///
    /// # Panics
    /// Without rows, or with rows of another number of joints.
    #[must_use]
    pub fn fading(&self, rows: &[[Vec<f64>; 3]]) -> Self {
        let features: Vec<Vec<f64>> = (rows.iter())
            .map(|[q, qd, tau]| self.angles.row(q, qd, tau))
            .collect();
        let seen = Seen::of(&features, |row| self.scaled(row));
        let largest = self.largest(rows);
        if largest.iter().all(|most| *most == 0.0) {
            return self.clone(); // Its output is zero already.
        }
        let mut layers = self.layers.clone();
        while layers.len() < 3 {
            pass_on(&mut layers);
        }
        let last = layers.pop().expect("three layers");
        let beyond = seen.beyond();
        let outside = beyond.outputs;
        layers[0] = layers[0].above(&beyond);
        layers[1] = layers[1].beside(&LayerWeights::new(outside, vec![-1.0; outside], vec![1.0]));
        let one = LayerWeights::new(1, vec![1.0], vec![0.0]);
        for layer in &mut layers[2..] {
            *layer = layer.beside(&one);
        }
        let limit = |sign: f64| last.with_input(largest.iter().map(|most| sign * most));
        let within = LayerWeights::zero(last.inputs, 1).with_input([1.0]);
        layers.push(limit(1.0).above(&limit(-1.0)).above(&within));
        layers.push(limited(&largest));
        Self {
            layers,
            ..self.clone()
        }
        .rounded()
    }

    /// The features of a row, scaled.
    fn scaled(&self, row: &[f64]) -> Vec<f64> {
        let scaling = self.scaling.mean.iter().zip(&self.scaling.std);
        let scaled = row.iter().zip(scaling);
        scaled.map(|(x, (mean, std))| (x - mean) / std).collect()
    }

    /// The largest magnitude of each output over rows.
    fn largest(&self, rows: &[[Vec<f64>; 3]]) -> Vec<f64> {
        // These rates contain nothing but the network.
        let around = nothing_but("", rows[0][0].len(), self.on);
        let whole = with_residual(&around, self).expect("a network for these joints");
        let mut largest = vec![0.0_f64; self.on.outputs(whole.joints)];
        for row in rows {
            let rates = whole.program.eval(&[row.concat(), vec![0.0]].concat());
            let outputs = &rates[rates.len() - largest.len()..];
            for (most, output) in largest.iter_mut().zip(outputs) {
                *most = most.max(output.abs());
            }
        }
        largest
    }

    /// With every number rounded to f32.
    fn rounded(&self) -> Self {
        let flat: Vec<f64> = (to_f32(&self.flat()).into_iter().map(f64::from)).collect();
        self.with_flat(&flat)
    }
}

/// One more hidden layer, which passes on what the last layer reads: x = max(x, 0) - max(-x, 0).
fn pass_on(layers: &mut Vec<LayerWeights>) {
    let last = layers.pop().expect("a network has a layer");
    let size = last.inputs;
    let unit = |sign: f64| {
        let weight = DMatrix::from_diagonal_element(size, size, sign);
        LayerWeights::new(size, weight.as_slice().to_vec(), vec![0.0; size])
    };
    layers.push(unit(1.0).above(&unit(-1.0)));
    let rows = last.weight.chunks(size);
    let weight = rows.flat_map(|row| row.iter().copied().chain(row.iter().map(|w| -w)));
    layers.push(LayerWeights::new(2 * size, weight.collect(), last.bias));
}

/// u_k - v_k - F_k g from all u, all v and g.
fn limited(largest: &[f64]) -> LayerWeights {
    let outputs = largest.len();
    let row = |(k, most): (usize, &f64)| {
        let mut row = vec![0.0; 2 * outputs + 1];
        (row[k], row[outputs + k], row[2 * outputs]) = (1.0, -1.0, -most);
        row
    };
    let weight = largest.iter().enumerate().flat_map(row).collect();
    LayerWeights::new(2 * outputs + 1, weight, vec![0.0; outputs])
}

impl LayerWeights {
    /// Two layers with the same inputs combined into one, the other's outputs after its own.
    fn above(&self, other: &Self) -> Self {
        let join = |a: &[f64], b: &[f64]| [a, b].concat();
        Self::new(
            self.inputs,
            join(&self.weight, &other.weight),
            join(&self.bias, &other.bias),
        )
    }

    /// Two layers with separate inputs combined into one, the other's inputs and outputs after its own.
    fn beside(&self, other: &Self) -> Self {
        let rows = |layer: &Self, before: usize, after: usize| -> Vec<f64> {
            let pad = |row: &[f64]| [vec![0.0; before], row.to_vec(), vec![0.0; after]].concat();
            layer.weight.chunks(layer.inputs).flat_map(pad).collect()
        };
        let own = rows(self, 0, other.inputs);
        let others = rows(other, self.inputs, 0);
        let bias = [self.bias.as_slice(), &other.bias].concat();
        Self::new(self.inputs + other.inputs, [own, others].concat(), bias)
    }

    /// With one more input, which enters each output with a weight.
    fn with_input(&self, weights: impl IntoIterator<Item = f64>) -> Self {
        let rows = self.weight.chunks(self.inputs).zip(weights);
        let weight = rows.flat_map(|(row, last)| row.iter().copied().chain([last]));
        Self::new(self.inputs + 1, weight.collect(), self.bias.clone())
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{nothing_but, with_residual};
    use crate::model::{InputScaling, LastLayer, MlpSettings, MlpWeights};

    /// Rows of a pendulum whose torque is close to what its angle and speed ask for.
    fn rows() -> Vec<[Vec<f64>; 3]> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut row = || {
            let [q, qd, rest] = [1.0, 4.0, 0.3].map(|most| rng.random_range(-most..=most));
            [vec![q], vec![qd], vec![2.0 * q + 0.1 * qd + rest]]
        };
        (0..400).map(|_| row()).collect()
    }

    fn network(hidden: &[usize]) -> MlpWeights {
        let settings = MlpSettings {
            hidden: hidden.to_vec(),
            ..MlpSettings::for_joints(1)
        };
        let scaling = InputScaling::from_rows(3, rows().into_iter().map(|row| row.concat()));
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        MlpWeights::new(1, &settings, scaling, LastLayer::Random, &mut rng)
    }

    fn output(network: &MlpWeights, q: f64, qd: f64, tau: f64) -> f64 {
        let around = nothing_but("pendulum", 1, network.on);
        let dynamics = with_residual(&around, network).unwrap();
        dynamics.program.eval(&[q, qd, tau, 0.0])[1]
    }

    #[test]
    fn it_is_the_network_where_that_was_trained_and_nothing_far_away() {
        for hidden in [&[][..], &[16], &[16, 8], &[8, 8, 8, 8]] {
            let (network, rows) = (network(hidden), rows());
            let fading = network.fading(&rows);
            fading.check(1).unwrap();
            let mut largest = 0.0_f64;
            for [q, qd, tau] in &rows {
                let [own, faded] = [&network, &fading].map(|net| output(net, q[0], qd[0], tau[0]));
                assert!((own - faded).abs() < 1e-5, "{own} {faded}");
                largest = largest.max(own.abs());
            }
            assert!(largest > 0.1, "{largest}");
            // Faster than in training, at another angle, and with a torque that is usual, but not at that angle and
            // speed.
            for [q, qd, tau] in [[0.0, 9.0, 0.9], [2.5, 0.0, 5.0], [-0.9, 0.0, 1.8]] {
                assert!(output(&network, q, qd, tau).abs() > 1e-3);
                assert!(output(&fading, q, qd, tau).abs() < 1e-6);
            }
            // In between it is never larger than where it was trained.
            let sizes: Vec<f64> = (0..50)
                .map(|k| output(&fading, 0.0, 4.0 + 0.1 * f64::from(k), 0.4).abs())
                .collect();
            assert!(sizes.iter().all(|size| *size <= largest + 1e-6));
        }
    }
}
