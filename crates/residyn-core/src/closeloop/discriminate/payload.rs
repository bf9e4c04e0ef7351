use crate::expr::{Binary, Graph};
use crate::model::{Dynamics, Parameter};

/// A parameter of the declared equations that a payload raises by a known amount.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Payload {
    /// Index of the parameter.
    pub parameter: usize,
    /// Share of the parameter that the payload adds.
    pub share: f64,
    /// The amount added, in the parameter's unit.
    pub extra: f64,
    /// Logs with the payload are shifted later by this time (s).
    pub delay_s: f64,
}

/// Units of the parameters that a payload adds to.
const OF_MASS: [&str; 2] = ["kg", "kg m^2"];
impl Payload {
    /// A payload for each of the first `declared` parameters that a payload can add to.
    pub fn all(dynamics: &Dynamics, declared: usize, share: f64, delay_s: f64) -> Vec<Self> {
        let carries = |k: &usize| OF_MASS.contains(&dynamics.parameters[*k].unit.as_str());
        let of = |parameter: usize| Self {
            parameter,
            share,
            extra: share * dynamics.parameters[parameter].value,
            delay_s,
        };
        (0..declared).filter(carries).map(of).collect()
    }

    pub fn text(&self, dynamics: &Dynamics) -> String {
        let Parameter { name, unit, .. } = &dynamics.parameters[self.parameter];
        let percent = 100.0 * self.share;
        format!(
            "a payload that raises `{name}` by a known {:.3} {unit} ({percent:.0} %)",
            self.extra
        )
    }

    /// The model of a rig that carries the payload only in the later logs: one program, so that one fit can use all
    /// logs.
    pub fn on(&self, dynamics: &Dynamics) -> Dynamics {
        let mut graph = Graph::new();
        let mut inputs: Vec<_> = (dynamics.program.inputs().iter())
            .map(|name| graph.input(name))
            .collect();
        let layout = dynamics.layout();
        let (time, parameter) = (layout.time(), layout.parameters() + self.parameter);
        let switch = graph.constant(0.5 * self.delay_s);
        let carried = graph.binary(Binary::Less, switch, inputs[time]);
        for (input, change) in [(time, -self.delay_s), (parameter, self.extra)] {
            let change = graph.constant(change);
            let changed = graph.add(inputs[input], change);
            inputs[input] = graph.select(carried, changed, inputs[input]);
        }
        let outputs = graph.append(&dynamics.program, &inputs);
        Dynamics {
            program: graph.finish(&outputs),
            ..dynamics.clone()
        }
    }
}
