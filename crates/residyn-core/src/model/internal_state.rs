//! States that effects have of their own: the deflection of a bristle, a temperature.

use crate::expr::{Binary, Formula, Graph, Node, Program, Scope};

use super::assemble::lower;
use super::effect::TRANSMISSION_NAMES;
use super::filter::Filter;
use super::input_layout::InputLayout;

/// A state of an effect, beside the angle and the velocity of its joint.
#[derive(Debug, Clone, PartialEq)]
pub struct InternalState {
    pub name: String,
    pub unit: String,
    pub about: String,
    /// Its time derivative, in the names that the effect's formula may use. `None` for the states of a transmission,
    /// which follow from the motion of both of its sides.
    pub rate: Option<Formula>,
    /// Its value before a log begins, in the effect's parameters; zero if the file does not say.
    pub start: Option<Formula>,
    /// The ends of the range that it stays in, in the names of `rate`: at an end it moves only back.
    pub within: Option<[Formula; 2]>,
}

/// The internal states of a compiled model.
#[derive(Debug, Clone, PartialEq)]
pub struct InternalStates {
    /// As the inputs of the model's program are named.
    pub names: Vec<String>,
    /// The mean rate of each over a step, from the inputs of the model's program.
    pub rates: Program,
    /// The value of each before a log begins, from the model's parameters.
    pub starts: Program,
    /// Whether each has come to rest under what acts at a log's first row.
    pub settled: Vec<bool>,
    /// What depends on what: state by state, and then by parameter.
    pub pairs: Vec<Dependence>,
}

/// A parameter on which an internal state depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dependence {
    /// Index among the internal states.
    pub state: usize,
    /// Index into the model's parameters.
    pub parameter: usize,
}

impl InternalStates {
    /// States of these names and values at rest, of a model with these parameters whose rates are known only all together.
    pub fn at_rest<'p>(
        names: Vec<String>,
        starts: &[f64],
        parameters: impl Iterator<Item = &'p str>,
    ) -> Self {
        let mut graph = Graph::new();
        for name in parameters {
            graph.input(name);
        }
        let starts: Vec<Node> = starts.iter().map(|start| graph.constant(*start)).collect();
        Self {
            settled: vec![false; names.len()],
            names,
            rates: Graph::new().finish(&[]),
            starts: graph.finish(&starts),
            pairs: Vec::new(),
        }
    }

    pub(super) fn new(
        (names, settled): (Vec<String>, Vec<bool>),
        [rates, starts]: [Program; 2],
        layout: InputLayout,
        filters: &[Filter],
    ) -> Self {
        let states = names.len();
        let read = |state: usize| rates.of_output(state).inputs_read();
        let read: Vec<Vec<bool>> = (0..states).map(read).collect();
        let mut reached: Vec<Vec<bool>> = (0..states)
            .map(|state| starts.of_output(state).inputs_read())
            .collect();
        for (reached, read) in reached.iter_mut().zip(&read) {
            for (parameter, reached) in reached.iter_mut().enumerate() {
                let filters = filters.iter().filter(|own| own.parameter == parameter);
                let mut filtered = filters.map(|own| read[layout.driving_of(own.joint)]);
                *reached |= read[layout.parameters() + parameter] || filtered.any(|own| own);
            }
        }
        // As many rounds as a chain of states may be long.
        for _ in 1..states {
            for state in 0..states {
                for other in 0..states {
                    let places = [layout.internal().start, layout.starts().start];
                    if places.iter().any(|first| read[state][first + other]) {
                        let through = reached[other].clone();
                        let both = reached[state].iter_mut().zip(through);
                        both.for_each(|(own, through)| *own |= through);
                    }
                }
            }
        }
        let pairs = reached.iter().enumerate().flat_map(|(state, reached)| {
            let reached = reached.iter().enumerate().filter(|(_, reached)| **reached);
            reached.map(move |(parameter, _)| Dependence { state, parameter })
        });
        Self {
            pairs: pairs.collect(),
            names,
            settled,
            rates,
            starts,
        }
    }
}

/// Shorter steps count as this long where a range limits a rate, s: zero steps have rates as well.
pub(super) const SHORTEST_S: f64 = 1e-9;

impl InternalState {
    /// By what a motor leads its link, which may have ends, and how fast that grows.
    pub(super) fn of_transmission(free_within: Option<[Formula; 2]>) -> [Self; 2] {
        let [twist, twist_rate, _] = TRANSMISSION_NAMES;
        let states = [
            (twist, "rad", "angle by which the motor leads the link"),
            (twist_rate, "rad/s", "rate of the twist"),
        ];
        let [mut twist, rate] = states.map(|(name, unit, about)| Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            about: about.to_owned(),
            rate: None,
            start: None,
            within: None,
        });
        twist.within = free_within;
        [twist, rate]
    }

    /// All of its formulas that may mention more than parameters.
    pub fn formulas(&self) -> impl Iterator<Item = &Formula> {
        self.rate.iter().chain(self.within.iter().flatten())
    }

    /// A mean rate that leaves the state within its range.
    fn within_ends(
        &self,
        graph: &mut Graph,
        scope: &Scope,
        [start, step]: [Node; 2],
        mean: Node,
    ) -> Node {
        let Some(ends) = &self.within else {
            return mean;
        };
        let ends = ends.each_ref().map(|end| lower(scope, graph, end));
        let ends = means_to(graph, &ends, [start, step]);
        between(graph, ends, mean)
    }

    /// Its value before a log begins.
    pub(super) fn start(&self, graph: &mut Graph, scope: &Scope) -> Node {
        match &self.start {
            Some(formula) => lower(scope, graph, formula),
            None => graph.constant(0.0),
        }
    }
}

/// The mean rates of an effect's states over a step of the length `step` that begins at `starts`, with everything else as
/// `scope` has it.
///
/// With the matrix A of the rates' derivatives with respect to the states, the step is that of a linear equation. For one
/// state its exponential exp(A h) is taken as 1/(1 - A h + (A h)^2/2), which never overshoots; for two, which may swing, as
/// (1 + A h/3)/(1 - 2 A h/3 + (A h)^2/6), which damps a swing nine times less. Both decay however fast the states do.
pub(super) fn mean_rates(
    states: &[InternalState],
    graph: &mut Graph,
    mut scope: Scope,
    (starts, step): (&[Node], Node),
) -> Vec<Node> {
    for (state, start) in states.iter().zip(starts) {
        scope.bind(&state.name, *start);
    }
    let rates = states.iter().filter_map(|state| state.rate.as_ref());
    let rates: Vec<Node> = rates.map(|rate| lower(&scope, graph, rate)).collect();
    let growth = graph.jacobian(&rates, starts);
    let growth = growth.into_iter().map(|row| {
        let scaled = row.into_iter().map(|slope| graph.mul(slope, step));
        scaled.collect::<Vec<Node>>()
    });
    let growth: Vec<Vec<Node>> = growth.collect();
    let means = match (rates.as_slice(), growth.as_slice()) {
        ([rate], [growth]) => vec![mean_of_one(graph, *rate, growth[0])],
        ([a, b], [first, second]) => {
            let growth = [[first[0], first[1]], [second[0], second[1]]];
            mean_of_two(graph, [*a, *b], growth).to_vec()
        }
        _ => unreachable!("checked when the file was read"),
    };
    let each = states.iter().zip(starts).zip(means);
    each.map(|((state, start), mean)| state.within_ends(graph, &scope, [*start, step], mean))
        .collect()
}

/// The mean rates with which a state that begins a step at `start` ends it at each of these values.
pub(super) fn means_to<const N: usize>(
    graph: &mut Graph,
    ends: &[Node; N],
    [start, step]: [Node; 2],
) -> [Node; N] {
    let shortest = graph.constant(SHORTEST_S);
    let step = graph.binary(Binary::Max, step, shortest);
    ends.map(|end| {
        let way = graph.sub(end, start);
        graph.div(way, step)
    })
}

/// What is nearest to a mean rate within these ends.
pub(super) fn between(graph: &mut Graph, [low, high]: [Node; 2], mean: Node) -> Node {
    let raised = graph.binary(Binary::Max, mean, low);
    graph.binary(Binary::Min, raised, high)
}

/// (1 - g/2) / (1 - g + g^2/2) times the rate, for the growth g over the step.
fn mean_of_one(graph: &mut Graph, rate: Node, growth: Node) -> Node {
    if graph.is_zero(growth) {
        return rate;
    }
    let [half, one] = [0.5, 1.0].map(|value| graph.constant(value));
    let half = graph.mul(half, growth);
    let above = graph.sub(one, half);
    let square = graph.mul(half, growth);
    let rest = graph.sub(one, growth);
    let below = graph.add(rest, square);
    let share = graph.div(above, below);
    graph.mul(rate, share)
}

/// (1 - G/6) (1 - 2 G/3 + G^2/6)^-1 times the rates of two states, whose growths are the matrix G.
pub(super) fn mean_of_two(
    graph: &mut Graph,
    rates: [Node; 2],
    growth: [[Node; 2]; 2],
) -> [Node; 2] {
    if growth.iter().flatten().all(|entry| graph.is_zero(*entry)) {
        return rates;
    }
    let [sixth, most, one, zero] =
        [1.0 / 6.0, 2.0 / 3.0, 1.0, 0.0].map(|value| graph.constant(value));
    let mut matrix = [[zero; 2]; 2];
    for (row, of_row) in matrix.iter_mut().enumerate() {
        for (column, entry) in of_row.iter_mut().enumerate() {
            let of_column = [growth[0][column], growth[1][column]];
            let square = graph.dot(&growth[row], &of_column);
            let square = graph.mul(sixth, square);
            let rest = if row == column { one } else { zero };
            let own = graph.mul(most, growth[row][column]);
            let rest = graph.sub(rest, own);
            *entry = graph.add(rest, square);
        }
    }
    let [[a, b], [c, d]] = matrix;
    let [ad, bc] = [(a, d), (b, c)].map(|(x, y)| graph.mul(x, y));
    let determinant = graph.sub(ad, bc);
    let solved = [[d, b, rates[0], rates[1]], [a, c, rates[1], rates[0]]];
    let solved = solved.map(|[own, other, rate, further]| {
        let [plus, minus] = [(own, rate), (other, further)].map(|(x, y)| graph.mul(x, y));
        let above = graph.sub(plus, minus);
        graph.div(above, determinant)
    });
    [0, 1].map(|row| {
        let moved = graph.dot(&growth[row], &solved);
        let moved = graph.mul(sixth, moved);
        graph.sub(solved[row], moved)
    })
}
