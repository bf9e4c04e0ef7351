use std::sync::Arc;

use super::network::{MlpWeights, ResidualOn};
use super::{Dynamics, Parameter};
use crate::expr::{Graph, Node, Program};

/// A hybrid model without its learnable numbers, for those who carry out its networks themselves: one program for
/// everything around them, and its derivative.
#[derive(Debug)]
pub(crate) struct Frame {
    pub joints: usize,
    /// The networks whose outputs are added to the last of the rates: the prior, where it is one, and the residual.
    pub networks: Vec<Arc<MlpWeights>>,
    /// Whether the first of them is the prior.
    pub has_prior: bool,
    /// Whether the last of them is a residual.
    pub has_residual: bool,
    /// The physical parameters; none where the prior is a network.
    pub parameters: Vec<Parameter>,
    /// Inputs as in [`Dynamics`]. Outputs: `2n` rates without the networks, then the scaled features of each network.
    pub program: Program,
    /// Inputs: those of `program`, then the derivative of a number by each of its outputs. Outputs: that number's
    /// derivatives by the `2n` states, then by each parameter that is not fixed.
    pub adjoint: Program,
    /// As `adjoint`, by the parameters alone.
    pub parameter_adjoint: Program,
}

impl Frame {
    pub(super) fn new(
        joints: usize,
        equations: Option<&Dynamics>,
        prior: Option<&Arc<MlpWeights>>,
        residual: Option<&Arc<MlpWeights>>,
    ) -> Self {
        let networks: Vec<_> = prior.into_iter().chain(residual).cloned().collect();
        let parameters = equations.map_or_else(Vec::new, |d| d.parameters.clone());
        let mut outline = Outline::new(joints, &parameters);
        let mut outputs = match (equations, prior) {
            (Some(dynamics), _) => outline
                .graph
                .append(&dynamics.program, &outline.inputs.clone()),
            (None, prior) => outline.rates_around(prior.map(|prior| prior.on)),
        };
        for network in &networks {
            outputs.extend(outline.features(network));
        }
        let (adjoint, parameter_adjoint) = outline.adjoints(&outputs, &parameters);
        Self {
            joints,
            has_prior: prior.is_some(),
            has_residual: residual.is_some(),
            networks,
            parameters,
            program: outline.graph.finish(&outputs),
            adjoint,
            parameter_adjoint,
        }
    }
}

/// The program while it grows.
struct Outline {
    graph: Graph,
    joints: usize,
    inputs: Vec<Node>,
}

impl Outline {
    fn new(joints: usize, parameters: &[Parameter]) -> Self {
        let mut graph = Graph::new();
        let mut inputs = Vec::new();
        for stem in ["q", "qd", "tau"] {
            inputs.extend((1..=joints).map(|j| graph.input(&format!("{stem}{j}"))));
        }
        inputs.push(graph.input("t"));
        inputs.extend(parameters.iter().map(|p| graph.input(&p.name)));
        Self {
            graph,
            joints,
            inputs,
        }
    }

    /// The rates that a network is added to where there are no equations.
    fn rates_around(&mut self, on: Option<ResidualOn>) -> Vec<Node> {
        let n = self.joints;
        let mut rates = vec![self.graph.constant(0.0); 2 * n];
        if on != Some(ResidualOn::Derivative) {
            rates[..n].copy_from_slice(&self.inputs[n..2 * n]);
        }
        rates
    }

    fn features(&mut self, network: &MlpWeights) -> Vec<Node> {
        let n = self.joints;
        let (q, qd, tau) = (
            &self.inputs[..n],
            &self.inputs[n..2 * n],
            &self.inputs[2 * n..3 * n],
        );
        network.features(&mut self.graph, q, qd, tau)
    }

    /// The derivatives by states and free parameters, and by the latter alone.
    fn adjoints(&self, outputs: &[Node], parameters: &[Parameter]) -> (Program, Program) {
        let mut graph = self.graph.clone();
        let seeds: Vec<Node> = (0..outputs.len())
            .map(|k| graph.input(&format!("by output {k}")))
            .collect();
        let (states, own) = (2 * self.joints, 3 * self.joints + 1);
        let mut by = self.inputs[..states].to_vec();
        let of_parameters = self.inputs[own..].iter().zip(parameters);
        by.extend(
            of_parameters
                .filter(|(_, p)| !p.fixed)
                .map(|(node, _)| *node),
        );
        let slopes = graph.gradient(outputs, &seeds, &by);
        let of_parameters = graph.clone().finish(&slopes[states..]);
        (graph.finish(&slopes), of_parameters)
    }
}
