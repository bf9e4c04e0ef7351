use rand::Rng;
use serde::Serialize;
use serde_json::json;

use super::prediction::Prediction;
use super::{Answers, Samples};
use crate::model::{
    CommandFilter, Dynamics, Integrator, MlpWeights, ModelWeights, NetworkError, Parameter, System,
    nothing_but, with_residual,
};

/// A model as every format reads it: the equations with their values, the networks whose outputs are added to their
/// derivative, and how both become steps.
#[derive(Debug, Clone)]
pub struct Portable {
    /// What the model file says.
    pub system: System,
    /// What stands around the networks, its parameters at the values to export.
    pub equations: Dynamics,
    /// The network that stands in place of equations, where one does.
    pub prior: Option<MlpWeights>,
    /// The network for what the equations or the prior lack.
    pub residual: Option<MlpWeights>,
    /// What the equations carry of the library of effects.
    pub effects: Vec<CarriedEffect>,
    pub integrator: Integrator,
    /// How long a torque is held, in s.
    pub step_s: f64,
    /// The configuration and the seed that the model came of.
    pub origin: serde_json::Value,
}

/// An effect that a model carries, in the names of the model's parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CarriedEffect {
    pub name: String,
    /// Counted from 1.
    pub joint: usize,
    pub expression: String,
    pub parameters: Vec<String>,
}

impl Portable {
    /// The model of `system` with these numbers: values for all parameters of the equations with their effects, or a
    /// network in their place; and a residual.
    pub fn new(
        system: &System,
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
            None => system.dynamics(&system.sign()).with_values(parameters),
        };
        keep_intervals(&mut equations);
        Self {
            system: system.clone(),
            effects: carried(system, &equations),
            equations,
            prior,
            residual,
            integrator,
            step_s,
            origin,
        }
    }

    /// The model that a file states, with its own values.
    pub fn stated(
        system: &System,
        integrator: Integrator,
        step_s: f64,
        origin: serde_json::Value,
    ) -> Self {
        let numbers = ModelWeights {
            parameters: system.dynamics(&system.sign()).values(),
            prior: None,
            residual: None,
        };
        Self::new(system, numbers, integrator, step_s, origin)
    }

    /// The equations without the file's effects, where no network takes their place.
    pub fn declared(&self) -> Dynamics {
        let declared = self.system.dynamics_with(&[], &self.system.sign());
        declared.with_values(self.equations.values())
    }

    /// Name of the system.
    pub fn name(&self) -> &str {
        &self.equations.name
    }

    /// Number of joints n.
    pub fn joints(&self) -> usize {
        self.equations.joints
    }

    /// The networks in the order in which they are evaluated. Each gives n or `2n` outputs, added to the last of the
    /// rates.
    pub fn networks(&self) -> impl Iterator<Item = &MlpWeights> {
        self.prefixed().map(|(_, network)| network)
    }

    /// The same, each with the prefix of its tensors' names.
    pub(super) fn prefixed(&self) -> impl Iterator<Item = (&'static str, &MlpWeights)> {
        let prior = self.prior.iter().map(|network| ("prior.", network));
        prior.chain(self.residual.iter().map(|network| ("", network)))
    }

    /// Every learnable number.
    pub fn weights(&self) -> ModelWeights {
        ModelWeights {
            parameters: self.equations.values(),
            prior: self.prior.clone(),
            residual: self.residual.clone(),
        }
    }

    /// Unit of a joint's (counted from 0) position, and of its torque.
    pub fn units(&self, joint: usize) -> [&'static str; 2] {
        if self.system.prismatic[joint] {
            ["m", "N"]
        } else {
            ["rad", "N m"]
        }
    }

    /// Whether the motion depends on time other than through the torque.
    pub fn depends_on_time(&self) -> bool {
        let program = &self.equations.program;
        let time = program.ops().iter().position(
            |op| matches!(op, crate::expr::Op::Input(k) if *k as usize == 3 * self.joints()),
        );
        let mut operands = program.ops().iter().flat_map(|op| op.operands());
        operands.any(|node| Some(node.index()) == time)
    }

    /// Meaning and interval of each parameter, as far as they are known, for a comment beside it.
    pub(super) fn parameter_notes(&self) -> Vec<String> {
        let file: toml::Table = toml::from_str(&self.system.text).unwrap_or_default();
        let about = |name: &str| {
            let about = file.get("parameters")?.get(name)?.get("about")?;
            about.as_str().map(str::to_owned)
        };
        let acts = |name: &str| {
            let mut effects = self.effects.iter();
            let effect = effects.find(|effect| effect.parameters.iter().any(|p| p == name))?;
            let CarriedEffect {
                name,
                joint,
                expression,
                ..
            } = effect;
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

    /// What no format carries of sensors that show something else than the rig's own angle.
    pub(super) fn sensor_limits(&self) -> Vec<String> {
        let shown = self.equations.reading.as_ref().map(|_| {
            "what the sensors show: positions are the rig's own, before play shifts them".to_owned()
        });
        let parameters = self.equations.parameters.iter().filter(|p| p.per_log);
        let own = parameters.map(|p| {
            let Parameter { name, value, .. } = p;
            format!("values of {name} that single logs have of their own: it is {value} for all")
        });
        shown.into_iter().chain(own).collect()
    }

    /// The time constant of a filter on a joint (counted from 0) in s, where the model has such a filter.
    pub fn filter(&self, joint: usize, kind: CommandFilter) -> Option<f64> {
        let mut filters = self.equations.filters.iter();
        let filter = filters.find(|filter| filter.joint == joint && filter.kind == kind)?;
        Some(self.equations.parameters[filter.parameter].value)
    }

    /// The whole model as one program, and its steps.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub(super) fn prediction(&self) -> Result<Prediction, NetworkError> {
        let mut networks = self.networks();
        let whole = networks.try_fold(self.equations.clone(), |dynamics, network| {
            with_residual(&dynamics, network)
        });
        Ok(Prediction {
            whole: whole?,
            integrator: self.integrator,
            step_s: self.step_s,
        })
    }

    /// Which program wrote a file, and what the model came of: for the head of every file.
    pub fn provenance(&self) -> serde_json::Value {
        json!({
            "residyn": env!("CARGO_PKG_VERSION"),
            "system": self.name(),
            "integrator": self.integrator,
            "step_s": self.step_s,
            "origin": self.origin,
        })
    }

    /// Points and a rollout at which readers of the model can be asked.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub fn samples(&self, rng: &mut impl Rng) -> Result<Samples, NetworkError> {
        Ok(Samples::draw(
            &self.prediction()?,
            &self.system.prismatic,
            rng,
        ))
    }

    /// What the program itself predicts there, in f64.
    ///
    /// # Errors
    /// A network that is not one for the model's joints.
    pub fn answers(&self, samples: &Samples) -> Result<Answers, NetworkError> {
        Ok(self.prediction()?.answers(samples))
    }
}

/// The file's intervals hold where the value is still within them.
fn keep_intervals(equations: &mut Dynamics) {
    for parameter in &mut equations.parameters {
        let value = parameter.value;
        let holds = |[low, high]: &[f64; 2]| (*low..=*high).contains(&value);
        parameter.ci95 = parameter.ci95.filter(holds);
    }
}

/// The effects of a model file, unless a network takes the place of its equations.
fn carried(system: &System, equations: &Dynamics) -> Vec<CarriedEffect> {
    let mut first = system.parameters.len();
    if equations.parameters.len() < first {
        return Vec::new();
    }
    let effects = system.effects.iter().map(|effect| {
        let own = &equations.parameters[first..first + effect.values.len()];
        first += own.len();
        let names: Vec<String> = own.iter().map(|p| p.name.clone()).collect();
        CarriedEffect {
            name: effect.effect.name.clone(),
            joint: effect.joint + 1,
            expression: effect.expression(&names),
            parameters: names,
        }
    });
    effects.collect()
}
