use serde::{Deserialize, Serialize};

use super::filter::Filter;
use crate::expr::Program;

/// A physical parameter of a model or an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    pub name: String,
    /// In `unit`.
    pub value: f64,
    /// SI, as text; empty for a pure number.
    pub unit: String,
    /// Lowest and highest admissible value; infinite where there is none.
    pub bounds: [f64; 2],
    /// Held at `value` in every fit.
    pub fixed: bool,
    /// Has a value of its own in each log.
    pub per_log: bool,
    /// 95 % interval, once a fit has found one.
    pub ci95: Option<[f64; 2]>,
    /// The magnitude in which steps are measured: the declared value's, or a typical one where that is zero.
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

/// A model ready to run: first-order differential equations as one program, and its parameters.
///
/// Inputs of the program, in this order: `q1..qn`, `qd1..qdn` (rad or m, and per second), `tau1..taun`
/// (N m or N), `t` (s), then the parameters in the order of `parameters`. Outputs: `dq/dt` (n values),
/// then `dqd/dt` (n values). The torques are those that act: what `filters` make of the commanded ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Dynamics {
    /// Name of the system, for messages and files.
    pub name: String,
    /// Number of joints n.
    pub joints: usize,
    pub parameters: Vec<Parameter>,
    pub program: Program,
    /// What the commanded torques go through first, see [`Commands`](crate::sim::Commands).
    pub filters: Vec<Filter>,
    /// What the sensors show for the angles, from the same inputs, where that is not the rig's own: n outputs. The
    /// torques are those that acted until then.
    pub reading: Option<Program>,
}

impl Dynamics {
    /// Values of all parameters, in order.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// The same with other values of the parameters, in their order.
    #[must_use]
    pub fn with_values(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        for (parameter, value) in self.parameters.iter_mut().zip(values) {
            parameter.value = value;
        }
        self
    }

    /// Number of states, 2n.
    pub fn states(&self) -> usize {
        2 * self.joints
    }
}
