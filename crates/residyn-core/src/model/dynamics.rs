use std::borrow::Cow;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::configuration::{Configuration, Differing, InLog};
use super::filter::Filter;
use super::input_layout::InputLayout;
use super::internal_state::InternalStates;
use crate::data::{Joint, Log, Quantity};
use crate::expr::Program;

/// A physical parameter of a model or an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    pub name: String,
    /// In `unit`.
    pub value: f64,
    /// SI, as text; empty for a pure number.
    pub unit: String,
    /// Lowest and highest admissible value; infinite if there is no bound.
    pub bounds: [f64; 2],
    /// Held at `value` in every fit.
    pub fixed: bool,
    /// Takes a separate value in each log.
    pub per_log: bool,
    /// These values are the same in all logs of a group: those of which the same tables `[logs."pattern"]` speak.
    pub per_group: bool,
    /// 95 % interval, once a fit has found one.
    pub ci95: Option<[f64; 2]>,
    /// Magnitude by which steps are scaled: that of the declared value, or 1 if it is zero; the typical one for
    /// effects.
    pub scale: f64,
}

impl Parameter {
    /// The same parameter, declared with another value.
    #[must_use]
    pub fn with_value(&self, value: f64) -> Self {
        Self {
            value,
            scale: if value == 0.0 { 1.0 } else { value.abs() },
            ..self.clone()
        }
    }
}

/// The value of a parameter in one log.
#[derive(Debug, Clone, PartialEq)]
pub struct PerLogValue {
    /// The log's path or name.
    pub log: String,
    /// Index into the parameters of its owner: an effect or a compiled model.
    pub parameter: usize,
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

impl PerLogValue {
    /// The log's file name.
    pub fn log_name(&self) -> String {
        let name = Path::new(&self.log).file_name();
        name.map_or_else(
            || self.log.clone(),
            |name| name.to_string_lossy().into_owned(),
        )
    }
}

/// A compiled model: first-order differential equations as one program, with the values of its parameters.
///
/// Inputs of the program, in this order: `q1..qn`, `qd1..qdn` (rad or m, and per second), the internal states of effects,
/// `tau1..taun` (N m or N) or the commands of the drives `cmd1..cmdn`, the further measured columns in the order of
/// `measured`, `t` (s), then the parameters in the order of `parameters`; before these, if there are internal states, their
/// values at the start of the step and its length (s). Outputs: `dq/dt` (n values), `dqd/dt` (n values), then the mean
/// rates of the internal states over the step. Torques or commands are those that act, after `filters`.
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamics {
    /// Name of the system, for messages and files.
    pub name: String,
    /// Number of joints n.
    pub joints: usize,
    /// Names of the further measured columns that it reads from logs.
    pub measured: Vec<String>,
    pub parameters: Vec<Parameter>,
    pub program: Program,
    /// The states that its effects have of their own, if they have any.
    pub internal: Option<InternalStates>,
    /// Filters of the commanded torques, see [`Commands`](crate::sim::Commands).
    pub filters: Vec<Filter>,
    /// The measured angles, from the same inputs (n outputs), unless they equal the true ones. The torques are those that
    /// acted until then.
    pub reading: Option<Program>,
    /// Values of parameters in single logs; `parameter` is an index into `parameters`.
    pub own: Vec<PerLogValue>,
    /// Values of parameters that the model file gives for some logs.
    pub configurations: Vec<Configuration>,
}

impl Dynamics {
    /// Values of all parameters, in order.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// The same model with other values of its parameters, in their order.
    #[must_use]
    pub fn with_values(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        for (parameter, value) in self.parameters.iter_mut().zip(values) {
            parameter.value = value;
        }
        self
    }

    /// The model with the values that its parameters have in this log.
    pub fn in_log(&self, log: &Log) -> Cow<'_, Self> {
        let mut in_log = Cow::Borrowed(self);
        for own in self.values_in(log) {
            in_log.to_mut().parameters[own.parameter].value = own.value;
        }
        in_log
    }

    /// The values of parameters in one log, where they are not those of all logs.
    pub fn values_in<'a>(&'a self, log: &'a Log) -> impl Iterator<Item = InLog> + 'a {
        let all = match self.own.is_empty() && self.configurations.is_empty() {
            true => &[],
            false => self.parameters.as_slice(),
        };
        let differing = self.differing();
        let value = move |(k, p): (usize, &Parameter)| differing.value(k, p.per_group, log);
        all.iter().enumerate().filter_map(value)
    }

    /// For each log the first one of its group, by their places in this list.
    pub fn groups(&self, logs: &[Log]) -> Vec<usize> {
        let group = |log: &Log| self.differing().group(&log.name());
        let groups: Vec<Vec<bool>> = logs.iter().map(group).collect();
        let first = |own| groups.iter().position(|group| group == own);
        groups.iter().filter_map(first).collect()
    }

    fn differing(&self) -> Differing<'_> {
        Differing {
            configurations: &self.configurations,
            own: &self.own,
        }
    }

    /// What drives the model: torques or commands, as the names of the program's inputs say.
    pub fn driven_by(&self) -> Quantity {
        let commands = Joint::at(0).name(Quantity::Command.key());
        match self.program.inputs().get(self.layout().driving().start) {
            Some(name) if *name == commands => Quantity::Command,
            _ => Quantity::Torque,
        }
    }

    /// The names of the further measured columns, in the order in which the program reads them.
    pub fn measured_names(&self) -> impl Iterator<Item = &str> {
        self.measured.iter().map(String::as_str)
    }

    /// Places of the program's inputs.
    pub fn layout(&self) -> InputLayout {
        let internal = self.internal.as_ref().map_or(0, |own| own.names.len());
        InputLayout::of(self.joints)
            .with_internal(internal)
            .with_measured(self.measured.len())
    }

    /// Number of states: 2n, and the internal ones.
    pub fn states(&self) -> usize {
        self.layout().states().len()
    }

    /// The rates of all states at a moment, at time 0: of positions, velocities and internal states, while `driving` acts.
    pub fn rates(&self, state: &[f64], driving: &[f64], values: &[f64]) -> Vec<f64> {
        let layout = self.layout();
        let mut inputs = vec![0.0; layout.parameters()];
        inputs[layout.states()].copy_from_slice(state);
        inputs[layout.driving()].copy_from_slice(driving);
        if !layout.internal().is_empty() {
            inputs[layout.starts()].copy_from_slice(&state[layout.internal()]);
        }
        inputs.extend_from_slice(values);
        self.program.eval(&inputs)
    }

    /// Whether some internal states are those of a motor behind a transmission: they alone come to rest under what acts at a
    /// log's first row.
    pub fn has_transmission(&self) -> bool {
        let mut internal = self.internal.iter();
        internal.any(|own| own.settled.contains(&true))
    }

    /// The internal states before a log begins, at these values of the parameters.
    pub fn internal_starts(&self, values: &[f64]) -> Vec<f64> {
        let starts = self.internal.as_ref().map(|own| own.starts.eval(values));
        starts.unwrap_or_default()
    }
}
