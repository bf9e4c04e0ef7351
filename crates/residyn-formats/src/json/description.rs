//! The description: a whole model except for its learnable numbers.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::discrete_filter::DiscreteFilter;
use crate::{ExportModel, ExportedEffect, ExportedState};
use residyn_core::data::Joint;
use residyn_core::expr::{Op, Program};
use residyn_core::model::{CommandFilter, ModelShape, Parameter};
use residyn_core::sim::Integrator;

/// Version of the description's own format.
pub(super) const VERSION: u64 = 1;

/// The JSON file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Description {
    /// Version of the description's format.
    pub residyn_model: u64,
    /// Version of the program that wrote it.
    pub residyn: String,
    pub about: String,
    #[serde(flatten)]
    pub shape: ModelShape,
    /// For each joint, whether it slides (m, N) rather than turns (rad, N m).
    pub prismatic: Vec<bool>,
    pub integrator: Integrator,
    pub step_s: f64,
    /// The file of the learnable numbers, next to this one.
    pub weights: PathBuf,
    /// Text of the model file.
    pub model_toml: String,
    /// Configuration and seed of the run that made the model.
    pub origin: Value,
    /// For readers that do not know model files.
    #[serde(skip_deserializing)]
    equations: Equations,
}

/// The equations as operations. They follow from the rest of the description.
#[derive(Debug, Clone, Default, Serialize)]
struct Equations {
    /// The values in the file of weights, repeated with units and intervals.
    parameters: Vec<Value>,
    effects: Vec<ExportedEffect>,
    /// Delays and lags of the commanded torques.
    filters: Vec<SavedFilter>,
    /// The filters, discretised for the file's step: `mean` torques over each substep and the lagged torque at the
    /// `end`, as coefficients of the lagged torque and of the torques at two `places`.
    held: Vec<DiscreteFilter>,
    /// Number of equal substeps in which a held step is integrated, each through these stages.
    substeps: usize,
    /// `[time, reach, weight]` as shares of a substep: when the stage is evaluated, how far along its slope the next
    /// one lies, and the weight of its slope.
    stages: Vec<[f64; 3]>,
    /// Whether positions move with the new velocities.
    semi_implicit: bool,
    /// The rates without the networks, as formulas.
    formulas: String,
    /// Names of the inputs of the operations. If effects have states, these include the states at the beginning of a
    /// substep and its length `step_s`; for the derivative at a moment, the states themselves and zero.
    inputs: Vec<String>,
    /// The states of effects behind the positions and velocities of a state, with their values at rest.
    states: Vec<ExportedState>,
    /// `["input", k]`, `["const", x]` or a function and the positions of its arguments in this list.
    operations: Vec<Value>,
    /// Indices of the operations that are the rates of the positions, the velocities and the states of effects.
    outputs: Vec<usize>,
    /// Prefixes of the networks' tensors, in the order in which their outputs are added to the last rates.
    networks: Vec<&'static str>,
}

/// A delay or lag of one joint's command.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct SavedFilter {
    pub joint: Joint,
    pub kind: CommandFilter,
    /// The parameter that is its time constant, in s.
    pub parameter: String,
}

impl Description {
    /// The description of a model whose learnable numbers, of this shape, are in the file `weights`.
    pub fn of(model: &ExportModel, shape: ModelShape, weights: PathBuf) -> Self {
        Self {
            residyn_model: VERSION,
            residyn: env!("CARGO_PKG_VERSION").to_owned(),
            about: model.system.about.clone(),
            shape,
            prismatic: model.system.prismatic.clone(),
            integrator: model.integrator,
            step_s: model.step_s,
            weights,
            model_toml: model.system.text.clone(),
            origin: model.origin.clone(),
            equations: Equations::of(model),
        }
    }
}

impl Equations {
    fn of(model: &ExportModel) -> Self {
        let equations = &model.equations;
        let program = &equations.program;
        let names: Vec<String> = (["q", "qd"].iter())
            .flat_map(|stem| (1..=model.joints()).map(move |j| format!("{stem}{j}")))
            .chain(model.internal().map(|(_, state)| state.name.clone()))
            .map(|state| format!("d({state})/dt"))
            .collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let scheme = model.integrator.scheme();
        Self {
            parameters: equations.parameters.iter().map(parameter).collect(),
            effects: model.effects.clone(),
            filters: (equations.filters.iter())
                .map(|filter| SavedFilter {
                    joint: filter.joint,
                    kind: filter.kind,
                    parameter: equations.parameters[filter.parameter].name.clone(),
                })
                .collect(),
            held: DiscreteFilter::all(model),
            substeps: model.integrator.substeps(),
            stages: (scheme.stages.iter())
                .map(|stage| [stage.time, stage.reach, stage.weight])
                .collect(),
            semi_implicit: scheme.semi_implicit,
            formulas: program.text(&names),
            inputs: program.inputs().to_vec(),
            states: model.internal().map(|(_, state)| state.clone()).collect(),
            operations: operations(program),
            outputs: program.outputs().iter().map(|node| node.index()).collect(),
            networks: model.prefixed().map(|(prefix, _)| prefix).collect(),
        }
    }
}

fn parameter(parameter: &Parameter) -> Value {
    json!({
        "name": parameter.name, "value": parameter.value, "unit": parameter.unit,
        "ci95": parameter.ci95, "fixed": parameter.fixed,
    })
}

fn operations(program: &Program) -> Vec<Value> {
    let operation = |op: &Op| match op {
        Op::Input(k) => json!(["input", k]),
        Op::Const(value) => json!(["const", value]),
        Op::Unary(f, a) => json!([f, a.index()]),
        Op::Binary(f, a, b) => json!([f, a.index(), b.index()]),
        Op::Where(c, a, b) => json!(["where", c.index(), a.index(), b.index()]),
    };
    program.ops().iter().map(operation).collect()
}
