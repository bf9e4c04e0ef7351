//! A model as the formats read it.

use rand::Rng;
use serde::Serialize;
use serde_json::json;

use super::ExportError;
use super::verify::{Predictions, ReferenceModel, Samples, draw};
use residyn_core::data::{Joint, Quantity};
use residyn_core::expr::{Op, Program};
use residyn_core::model::{
    CommandFilter, Dynamics, InternalState, MlpWeights, Model, ModelError, ModelWeights,
    NetworkError, Parameter, nothing_but,
};
use residyn_core::sim::Integrator;

/// A model as every format reads it: equations with their values, the networks whose outputs are added to their
/// derivative, and the step.
#[derive(Debug, Clone)]
pub struct ExportModel {
    /// What the model file says.
    pub system: Model,
    /// The equations without the networks, parameters at the values to export.
    pub equations: Dynamics,
    /// The network that replaces the equations, if any.
    pub prior: Option<MlpWeights>,
    /// The network for dynamics that the equations or the prior lack, if any.
    pub residual: Option<MlpWeights>,
    /// The effects in the equations.
    pub effects: Vec<ExportedEffect>,
    pub integrator: Integrator,
    /// How long a torque is held, in s.
    pub step_s: f64,
    /// The machine's task, for formats that have a reward.
    pub task: Option<ExportedTask>,
    /// Configuration and seed of the run that made the model.
    pub origin: serde_json::Value,
}

/// The task of an exported machine.
#[derive(Debug, Clone)]
pub struct ExportedTask {
    pub name: String,
    pub about: String,
    /// The reward of a step: a formula in the state after it, the torque held over it, and time.
    pub objective: String,
    /// The reward as a program of positions, velocities, torques and time, with one output.
    pub reward: Program,
    /// Lowest and highest torque of each joint, in N m (or N), or lowest and highest command of its drive.
    pub torque: Vec<[f64; 2]>,
    /// Positions, then velocities at the start.
    pub start: Vec<f64>,
    /// Half-width of the uniform distribution around each start value.
    pub start_spread: Vec<f64>,
    /// Steps of an episode.
    pub steps: usize,
    /// How long a torque is held, in s.
    pub step_s: f64,
}

/// An effect of an exported model, its formula in the model's parameter names.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExportedEffect {
    pub name: String,
    /// Counted from 1.
    pub joint: Joint,
    pub expression: String,
    pub parameters: Vec<String>,
    /// Its states, in the order in which they stand among those of the model.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<ExportedState>,
}

/// A state of an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExportedState {
    pub name: String,
    pub unit: String,
    pub about: String,
    /// Its value before anything has moved.
    pub start: f64,
}

impl ExportModel {
    /// The model of `system` with these numbers: values of all parameters, effects included, or a network in place of
    /// the equations; and a residual. `step_s` in s.
    pub fn new(
        system: &Model,
        numbers: ModelWeights,
        integrator: Integrator,
        step_s: f64,
        origin: serde_json::Value,
    ) -> Self {
        let ModelWeights {
            parameters,
            prior,
            residual,
        } = numbers;
        let mut equations = match &prior {
            Some(prior) => nothing_but(&system.name, system.joints, prior.on),
            None => system.dynamics().with_values(parameters),
        };
        keep_intervals(&mut equations);
        Self {
            system: system.clone(),
            effects: exported_effects(system, &equations),
            equations,
            prior,
            residual,
            integrator,
            step_s,
            task: None,
            origin,
        }
    }

    /// Refuses a model that reads further measured columns: whoever steps an exported file gives it states and torques.
    ///
    /// # Errors
    /// The first column that it reads.
    pub fn check_measured(&self) -> Result<(), ModelError> {
        self.system.runs_without_logs("an exported file")
    }

    /// The same model with a task.
    #[must_use]
    pub fn with_task(self, task: Option<ExportedTask>) -> Self {
        Self { task, ..self }
    }

    /// The same model with these intervals of its parameters, by their names, in place of its own.
    ///
    /// # Errors
    /// A parameter that the model lacks, or a value outside its interval.
    pub fn with_intervals(mut self, intervals: &[(&str, [f64; 2])]) -> Result<Self, String> {
        let parameters = &mut self.equations.parameters;
        for (name, [low, high]) in intervals {
            let named = |parameter: &&mut Parameter| parameter.name == *name;
            let Some(own) = parameters.iter_mut().find(named) else {
                return Err(format!("the model has no parameter `{name}`"));
            };
            let value = own.value;
            if !(*low..=*high).contains(&value) {
                return Err(format!(
                    "`{name}` is {value} in the model, not within {low} to {high}"
                ));
            }
            own.ci95 = Some([*low, *high]);
        }
        Ok(self)
    }

    /// The model of a file, with the file's own values.
    pub fn of_system(
        system: &Model,
        integrator: Integrator,
        step_s: f64,
        origin: serde_json::Value,
    ) -> Self {
        let numbers = ModelWeights {
            parameters: system.dynamics().values(),
            prior: None,
            residual: None,
        };
        Self::new(system, numbers, integrator, step_s, origin)
    }

    /// The equations without drives and effects.
    pub fn declared(&self) -> Dynamics {
        let bare = self.system.without_drive().with_effects(Vec::new());
        let declared = bare.dynamics();
        declared.with_values(self.equations.values())
    }

    /// Why this model cannot be written in a format.
    pub(super) fn refused(&self, format: &'static str, reason: String) -> ExportError {
        ExportError::Model {
            format,
            system: self.name().to_owned(),
            reason,
        }
    }

    /// Name of the system.
    pub fn name(&self) -> &str {
        &self.equations.name
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.equations.joints
    }

    /// Number of states: positions, velocities, then the states of effects.
    pub fn states(&self) -> usize {
        self.equations.states()
    }

    /// The states of effects, each with its effect, in their order among the states.
    pub(super) fn internal(&self) -> impl Iterator<Item = (&ExportedEffect, &ExportedState)> {
        let each = |effect| ExportedEffect::states_with(effect);
        self.effects.iter().flat_map(each)
    }

    /// What the states of effects are, in their order: `z1 of presliding`.
    pub(super) fn internal_labels(&self) -> impl Iterator<Item = String> {
        let label = |(effect, state): (&ExportedEffect, &ExportedState)| {
            format!("{} of {}", state.name, effect.name)
        };
        self.internal().map(label)
    }

    /// The state at rest, before anything has moved.
    pub(super) fn rest(&self) -> Vec<f64> {
        let internal = self.internal().map(|(_, state)| state.start);
        vec![0.0; 2 * self.joints()]
            .into_iter()
            .chain(internal)
            .collect()
    }

    /// Where states come to a stop at the ends of a range: an importer's own solver is not told when.
    pub(super) fn stops(&self) -> bool {
        let mut states = self
            .system
            .effects
            .iter()
            .flat_map(|own| &own.effect.states);
        let stops = |state: &InternalState| state.rate.is_some() && state.within.is_some();
        !self.effects.is_empty() && states.any(stops)
    }

    /// The networks by name, in order of evaluation. Each has n or `2n` outputs, added to the last of the rates.
    pub(super) fn networks(&self) -> impl Iterator<Item = (&'static str, &MlpWeights)> {
        let prior = self.prior.iter().map(|network| ("prior", network));
        prior.chain(self.residual.iter().map(|network| ("residual", network)))
    }

    /// The networks with the prefix of their tensors' names.
    pub(super) fn prefixed(&self) -> impl Iterator<Item = (&'static str, &MlpWeights)> {
        let prior = self.prior.iter().map(|network| ("prior.", network));
        prior.chain(self.residual.iter().map(|network| ("", network)))
    }

    /// Every learnable number.
    pub(super) fn weights(&self) -> ModelWeights {
        ModelWeights {
            parameters: self.equations.values(),
            prior: self.prior.clone(),
            residual: self.residual.clone(),
        }
    }

    /// Units of a joint's position and of its torque or command; a command's unit is unknown.
    pub(super) fn units(&self, joint: Joint) -> [&'static str; 2] {
        let [position, torque] = match self.system.prismatic[joint] {
            true => ["m", "N"],
            false => ["rad", "N m"],
        };
        match self.equations.driven_by() {
            Quantity::Command => [position, ""],
            _ => [position, torque],
        }
    }

    /// What drives the joints, in the plural.
    pub(super) fn driving(&self) -> &'static str {
        match self.equations.driven_by() {
            Quantity::Command => "commands of the drives",
            _ => "torques",
        }
    }

    /// Whether the equations use the time.
    pub(super) fn depends_on_time(&self) -> bool {
        reads(&self.equations.program, self.equations.layout().time())
    }

    /// The effect that a parameter of this name belongs to.
    pub(super) fn effect_of(&self, parameter: &str) -> Option<&ExportedEffect> {
        let mut effects = self.effects.iter();
        effects.find(|effect| effect.parameters.iter().any(|p| p == parameter))
    }

    /// Meaning and interval of each parameter, if known, for a comment.
    pub(super) fn parameter_notes(&self) -> Vec<String> {
        let file: toml::Table = toml::from_str(&self.system.text).expect("a model file is TOML");
        let about = |name: &str| {
            let about = file.get("parameters")?.get(name)?.get("about")?;
            about.as_str().map(str::to_owned)
        };
        let acts = |name: &str| {
            let ExportedEffect {
                name,
                joint,
                expression,
                ..
            } = self.effect_of(name)?;
            Some(format!("{name} on joint {joint}: {expression}"))
        };
        let note = |parameter: &Parameter| {
            let known = parameter
                .ci95
                .map(|[low, high]| format!("95 % interval {low} to {high}"));
            let meaning = about(&parameter.name).or_else(|| acts(&parameter.name));
            let parts = meaning.into_iter().chain(known);
            parts.collect::<Vec<_>>().join("; ")
        };
        self.equations.parameters.iter().map(note).collect()
    }

    /// Sensor properties that no format carries: measured positions that differ from the joint's.
    pub(super) fn sensors_not_carried(&self) -> Vec<String> {
        let shown = self.equations.reading.as_ref().map(|_| {
            "measured positions: they are the rig's true ones, without sensor play".to_owned()
        });
        let parameters = self.equations.parameters.iter().filter(|p| p.per_log);
        let own = parameters.map(|p| {
            let Parameter { name, value, .. } = p;
            format!("per-log values of {name}: {value} is written for all logs")
        });
        let differs = |k: &usize| {
            let mut given = self
                .equations
                .configurations
                .iter()
                .flat_map(|table| &table.given);
            given.any(|(parameter, _)| parameter == k)
        };
        let parameters = self.equations.parameters.iter().enumerate();
        let given = parameters.filter(|(k, _)| differs(k)).map(|(_, p)| {
            let Parameter { name, value, .. } = p;
            format!("values of {name} in [logs]: {value} is written for all logs")
        });
        shown.into_iter().chain(own).chain(given).collect()
    }

    /// The parameter that is the time constant (s) of a joint's delay or lag, if it has one.
    pub(super) fn filter_parameter(&self, joint: Joint, kind: CommandFilter) -> Option<&Parameter> {
        let mut filters = self.equations.filters.iter();
        let filter = filters.find(|filter| filter.joint == joint && filter.kind == kind)?;
        Some(&self.equations.parameters[filter.parameter])
    }

    /// The time constant of a joint's delay or lag, in s.
    pub(super) fn filter(&self, joint: Joint, kind: CommandFilter) -> Option<f64> {
        self.filter_parameter(joint, kind).map(|p| p.value)
    }

    /// The whole model as one program, and its step.
    ///
    /// # Errors
    /// A network that does not fit the number of joints.
    pub(super) fn reference(&self) -> Result<ReferenceModel, NetworkError> {
        let networks = self.networks().map(|(_, network)| network);
        ReferenceModel::new(
            self.equations.clone(),
            networks,
            self.integrator,
            self.step_s,
        )
    }

    /// The program's version, and the run's configuration and seed, for the head of every file.
    pub(super) fn provenance(&self) -> serde_json::Value {
        json!({
            "residyn": env!("CARGO_PKG_VERSION"),
            "system": self.name(),
            "integrator": self.integrator,
            "step_s": self.step_s,
            "origin": self.origin,
        })
    }

    /// Sample points and a rollout for the comparison of clients.
    ///
    /// # Errors
    /// A network that does not fit the number of joints.
    pub fn samples(&self, rng: &mut impl Rng) -> Result<Samples, NetworkError> {
        Ok(draw(&self.reference()?, &self.system.prismatic, rng))
    }

    /// The program's own predictions at samples, in f64.
    ///
    /// # Errors
    /// A network that does not fit the number of joints.
    pub fn predict(&self, samples: &Samples) -> Result<Predictions, NetworkError> {
        Ok(self.reference()?.predict(samples))
    }
}

/// Whether a program uses the input at this place.
pub(super) fn reads(program: &Program, input: usize) -> bool {
    let is_it = |op: &Op| matches!(op, Op::Input(k) if *k as usize == input);
    let node = program.ops().iter().position(is_it);
    let mut operands = program.ops().iter().flat_map(|op| op.operands());
    operands.any(|operand| Some(operand.index()) == node)
}

/// Keep a value's interval from the file only if the value lies within it.
fn keep_intervals(equations: &mut Dynamics) {
    for parameter in &mut equations.parameters {
        let value = parameter.value;
        let holds = |[low, high]: &[f64; 2]| (*low..=*high).contains(&value);
        parameter.ci95 = parameter.ci95.filter(holds);
    }
}

/// The effects of a model file; none if a network replaces the equations.
fn exported_effects(system: &Model, equations: &Dynamics) -> Vec<ExportedEffect> {
    let mut first = system.parameters.len();
    if equations.parameters.len() < first {
        return Vec::new();
    }
    let names = equations.internal.iter().flat_map(|own| own.names.clone());
    let starts = equations.internal_starts(&equations.values());
    let mut named = names.zip(starts);
    let effects = system.effects.iter().map(|effect| {
        let own = &equations.parameters[first..first + effect.values.len()];
        first += own.len();
        let names: Vec<String> = own.iter().map(|p| p.name.clone()).collect();
        ExportedEffect {
            name: effect.effect.name.clone(),
            joint: effect.joint,
            expression: effect.expression(&names, system.driven_by()),
            parameters: names,
            states: (effect.effect.states.iter().zip(named.by_ref()))
                .map(|(state, (name, start))| ExportedState {
                    name,
                    unit: state.unit.clone(),
                    about: state.about.clone(),
                    start,
                })
                .collect(),
        }
    });
    effects.collect()
}

impl ExportedEffect {
    fn states_with(&self) -> impl Iterator<Item = (&Self, &ExportedState)> {
        self.states.iter().map(move |state| (self, state))
    }
}
