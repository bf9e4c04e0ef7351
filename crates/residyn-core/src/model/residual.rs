//! Networks in the equations of motion.

use super::Dynamics;
use super::network::{Angles, LayerWeights, MlpWeights, NetworkError, ResidualOn};
use crate::expr::{Binary, Graph, Node, Unary};

impl MlpWeights {
    /// Write the network into a graph as operations; ReLU is `max(x, 0)`. Returns its outputs.
    ///
    /// # Panics
    /// When the network does not fit `q.len()` joints, see [`MlpWeights::check`].
    pub fn write(&self, graph: &mut Graph, q: &[Node], qd: &[Node], tau: &[Node]) -> Vec<Node> {
        let zero = graph.constant(0.0);
        let mut values = self.features(graph, q, qd, tau);
        for (k, layer) in self.layers.iter().enumerate() {
            values = layer.write(graph, &values);
            if k + 1 < self.layers.len() {
                for value in &mut values {
                    *value = graph.binary(Binary::Max, *value, zero);
                }
            }
        }
        values
    }

    /// Write the network's scaled inputs into a graph.
    pub fn features(&self, graph: &mut Graph, q: &[Node], qd: &[Node], tau: &[Node]) -> Vec<Node> {
        let mut features: Vec<Node> = Vec::new();
        match self.angles {
            Angles::Raw => features.extend(q),
            Angles::SinCos => {
                for op in [Unary::Sin, Unary::Cos] {
                    features.extend(q.iter().map(|q| graph.unary(op, *q)));
                }
            }
        }
        features.extend(qd.iter().chain(tau));
        let scaling = self.scaling.mean.iter().zip(&self.scaling.std);
        (features.iter().zip(scaling))
            .map(|(feature, (mean, std))| {
                let (mean, factor) = (graph.constant(*mean), graph.constant(1.0 / std));
                let centred = graph.sub(*feature, mean);
                graph.mul(centred, factor)
            })
            .collect()
    }
}

impl LayerWeights {
    fn write(&self, graph: &mut Graph, values: &[Node]) -> Vec<Node> {
        let rows = self.weight.chunks(self.inputs).zip(&self.bias);
        rows.map(|(row, bias)| {
            let mut sum = graph.constant(*bias);
            for (weight, value) in row.iter().zip(values) {
                let weight = graph.constant(*weight);
                let part = graph.mul(weight, *value);
                sum = graph.add(sum, part);
            }
            sum
        })
        .collect()
    }
}

/// The same model with a network's outputs added to its derivative, again as one program.
///
/// # Errors
/// When the network does not fit the joints of `dynamics`.
pub fn with_residual(dynamics: &Dynamics, mlp: &MlpWeights) -> Result<Dynamics, NetworkError> {
    let layout = dynamics.layout();
    mlp.check(dynamics.joints)?;
    let mut graph = Graph::new();
    let inputs: Vec<Node> = (dynamics.program.inputs().iter())
        .map(|name| graph.input(name))
        .collect();
    let mut outputs = graph.append(&dynamics.program, &inputs);
    let residual = mlp.write(
        &mut graph,
        &inputs[layout.positions()],
        &inputs[layout.velocities()],
        &inputs[layout.driving()],
    );
    let first = layout.internal().start - residual.len();
    for (output, part) in outputs[first..].iter_mut().zip(residual) {
        *output = graph.add(*output, part);
    }
    Ok(Dynamics {
        program: graph.finish(&outputs),
        ..dynamics.clone()
    })
}

/// The rates that a network is added to if there are no equations: zero, or dq/dt = qd if it gives accelerations alone.
pub fn nothing_but(name: &str, joints: usize, on: ResidualOn) -> Dynamics {
    let mut graph = Graph::new();
    let numbered = |stem: &'static str| (1..=joints).map(move |joint| format!("{stem}{joint}"));
    let names = ["q", "qd", "tau"]
        .into_iter()
        .flat_map(numbered)
        .chain(["t".to_owned()]);
    let inputs: Vec<Node> = names.map(|name| graph.input(&name)).collect();
    let mut rates = vec![graph.constant(0.0); 2 * joints];
    if on == ResidualOn::Accelerations {
        rates[..joints].copy_from_slice(&inputs[joints..2 * joints]);
    }
    Dynamics {
        name: name.to_owned(),
        joints,
        measured: Vec::new(),
        parameters: Vec::new(),
        program: graph.finish(&rates),
        internal: None,
        filters: Vec::new(),
        reading: None,
        own: Vec::new(),
        configurations: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{nothing_but, with_residual};
    use crate::model::{InputScaling, LastLayer, MlpSettings, MlpWeights};

    #[test]
    fn a_network_with_other_scaling_is_the_same_function() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let settings = MlpSettings::for_joints(1);
        let scaling = InputScaling {
            mean: vec![0.3, -1.0, 0.1],
            std: vec![0.2, 2.0, 0.7],
        };
        let network = MlpWeights::new(1, &settings, scaling, LastLayer::Random, &mut rng);
        let other = InputScaling {
            mean: vec![-0.5, 2.0, 0.0],
            std: vec![3.0, 5.0, 1.5],
        };
        let rescaled = network.rescaled(other.clone());
        assert_eq!(rescaled.scaling, other);
        let rates = |network: &MlpWeights| {
            let around = nothing_but("pendulum", 1, network.on);
            let dynamics = with_residual(&around, network).unwrap();
            dynamics.program.eval(&[0.7, -1.5, 0.4, 0.0])
        };
        for (a, b) in rates(&network).into_iter().zip(rates(&rescaled)) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
}
