use residyn_core::expr::{Graph, Node, Program};
use residyn_core::model::{Dynamics, InputLayout, MlpWeights, Parameter, nothing_but};

/// A hybrid model without its learnable numbers: declared equations and networks, and one program, with its derivative,
/// for everything but the networks.
#[derive(Debug)]
pub(crate) struct Structure {
    /// Name of the system.
    pub system: String,
    pub joints: usize,
    /// Places of the inputs of `program`.
    pub layout: InputLayout,
    /// The prior as declared, if it is equations.
    pub equations: Option<Dynamics>,
    /// The networks whose outputs are added to the last rates: the prior, if it is one, and the residual.
    pub networks: Vec<MlpWeights>,
    /// Whether the last network is a residual.
    pub has_residual: bool,
    /// Inputs as in [`Dynamics`]. Outputs: the rates of all states without the networks, then the scaled features of each
    /// network.
    pub program: Program,
    /// The reverse derivative of `program`. Inputs: those of `program`, with the derivatives of a quantity by each output
    /// before the parameters. Outputs: its derivatives by the states, by the internal ones at the start of the substep, then by
    /// each parameter that is not fixed.
    pub adjoint: Program,
    /// `adjoint` with respect to the parameters alone.
    pub parameter_adjoint: Program,
}

impl Structure {
    /// Equations alone.
    pub(super) fn of_equations(dynamics: &Dynamics) -> Self {
        let (system, joints) = (dynamics.name.clone(), dynamics.joints);
        Self::new(system, joints, Some(dynamics.clone()), Vec::new(), false)
    }

    /// A network alone.
    pub(super) fn of_network(system: &str, joints: usize, prior: &MlpWeights) -> Self {
        Self::new(system.to_owned(), joints, None, vec![prior.clone()], false)
    }

    /// The same structure with this residual in place of any other.
    pub(super) fn with_residual(&self, residual: &MlpWeights) -> Self {
        let mut networks = self.networks.clone();
        networks.truncate(usize::from(self.equations.is_none()));
        networks.push(residual.clone());
        let (system, equations) = (self.system.clone(), self.equations.clone());
        Self::new(system, self.joints, equations, networks, true)
    }

    /// The physical parameters as declared; none if the prior is a network.
    pub(crate) fn parameters(&self) -> &[Parameter] {
        let equations = self.equations.as_ref();
        equations.map_or(&[], |dynamics| &dynamics.parameters)
    }

    /// Number of states: positions, velocities, then internal states.
    pub(crate) fn states(&self) -> usize {
        self.layout.states().len()
    }

    fn new(
        system: String,
        joints: usize,
        equations: Option<Dynamics>,
        networks: Vec<MlpWeights>,
        has_residual: bool,
    ) -> Self {
        let around = match &equations {
            Some(dynamics) => dynamics.clone(),
            None => nothing_but(&system, joints, networks[0].on),
        };
        let layout = around.layout();
        let mut builder = Builder::new(&around.program, layout);
        let mut outputs = builder.append(&around.program);
        for network in &networks {
            outputs.extend(builder.features(network));
        }
        let program = builder.graph.finish(&outputs);
        let (adjoint, parameter_adjoint) = adjoints(&program, layout, &around.parameters);
        Self {
            system,
            joints,
            layout,
            equations,
            networks,
            has_residual,
            program,
            adjoint,
            parameter_adjoint,
        }
    }
}

/// The program under construction.
struct Builder {
    graph: Graph,
    layout: InputLayout,
    inputs: Vec<Node>,
}

impl Builder {
    /// With the inputs of the equations.
    fn new(equations: &Program, layout: InputLayout) -> Self {
        let mut graph = Graph::new();
        let names = equations.inputs().iter();
        Self {
            inputs: names.map(|name| graph.input(name)).collect(),
            graph,
            layout,
        }
    }

    fn append(&mut self, program: &Program) -> Vec<Node> {
        self.graph.append(program, &self.inputs)
    }

    fn features(&mut self, network: &MlpWeights) -> Vec<Node> {
        let layout = self.layout;
        let [q, qd, tau] = [layout.positions(), layout.velocities(), layout.driving()]
            .map(|places| &self.inputs[places]);
        network.features(&mut self.graph, q, qd, tau)
    }
}

/// The derivatives of a program by states, by internal states at the start of the substep, and by free parameters; and by the
/// latter alone.
fn adjoints(
    program: &Program,
    layout: InputLayout,
    parameters: &[Parameter],
) -> (Program, Program) {
    let mut graph = Graph::new();
    let (of_point, of_parameters) = program.inputs().split_at(layout.parameters());
    let mut inputs: Vec<Node> = of_point.iter().map(|name| graph.input(name)).collect();
    let seeds: Vec<Node> = (0..program.output_count())
        .map(|k| graph.input(&format!("by output {k}")))
        .collect();
    inputs.extend(of_parameters.iter().map(|name| graph.input(name)));
    let outputs = graph.append(program, &inputs);
    let mut by = [&inputs[layout.states()], &inputs[layout.starts()]].concat();
    let of_states = by.len();
    let free = inputs[of_point.len()..].iter().zip(parameters);
    by.extend(free.filter(|(_, p)| !p.fixed).map(|(node, _)| *node));
    let slopes = graph.gradient(&outputs, &seeds, &by);
    let by_parameters = graph.clone().finish(&slopes[of_states..]);
    (graph.finish(&slopes), by_parameters)
}
