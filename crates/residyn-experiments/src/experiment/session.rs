use std::path::PathBuf;

use serde_json::{Value, json};

use super::learning::{Method, Observer};
use super::{Config, ExperimentError};
use crate::mbrl::{Prior, Run, Schedule};
use residyn_control::control::Task;
use residyn_core::model::{FittedEffect, Library};
use residyn_core::plant::Plant;
use residyn_io::files::beside_or_named;
use residyn_io::runs::{Identity, RunFolder, Shard};
use residyn_plants::{Controlled, Reach, Unsuited};
use residyn_train::Backend;

/// A configuration with everything it refers to read.
pub struct Session {
    pub config: Config,
    pub(super) task: Task,
    pub(super) plant: Controlled,
    /// The plant's own equations, if they are known.
    pub(super) truth: Option<Plant>,
    pub(super) methods: Vec<Method>,
    backend: Backend,
    first_seed: u64,
}

impl Session {
    /// Reads everything that `config` refers to. The seeds are `first_seed` and those that follow.
    ///
    /// # Errors
    /// Files that cannot be read or do not match, and a plant that cannot be reached.
    pub fn open(
        config: Config,
        library: &Library,
        backend: Backend,
        first_seed: u64,
        reach: Reach,
    ) -> Result<Self, ExperimentError> {
        let mut task = Task::read(&beside_or_named(&config.path, &config.task))?;
        if task.steps % config.gather != 0 {
            return Err(config.wrong(format!(
                "`gather` is {}, but an episode of {} has {} steps; choose a divisor of it",
                config.gather,
                task.name(),
                task.steps
            )));
        }
        let plant = Controlled::open(&config.plant, Some(&config.path), library, reach)?;
        let truth = config.truth(&plant, library)?;
        let system = match &truth {
            Some(plant) => plant.system.clone(),
            None => config.declared(library)?,
        };
        if system.name != task.system || system.joints != task.joints() {
            return Err(config.wrong(format!(
                "the task {} is for {}, but the plant is {}; name a plant of that system",
                task.name(),
                task.system,
                system.name
            )));
        }
        let unsuited = |error: Unsuited| config.wrong(error.to_string());
        plant.bound(&mut task, &system).map_err(unsuited)?;
        if plant.moves_by_itself() && config.gather != task.steps {
            return Err(config.wrong(format!(
                "`gather` is {}, but a plant that moves by itself cannot be stopped within an episode; gather whole ones of \
                 {} steps",
                config.gather, task.steps
            )));
        }
        let methods = (config.method.iter())
            .map(|method| Method::read(method, &config, &system, library, backend))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            config,
            task,
            plant,
            truth,
            methods,
            backend,
            first_seed,
        })
    }

    /// Number of trainings in a shard of an experiment.
    pub fn rounds(&self, shard: Shard) -> usize {
        let pieces = shard.share(self.pieces());
        pieces.map(|piece| piece.rounds()).sum()
    }

    /// Number of trainings of one run of a method; 0 for an unknown method.
    pub fn rounds_of(&self, method: &str) -> usize {
        self.method(method).map_or(0, |known| known.config.rounds)
    }

    /// Carries out one run of the loop, with the method of this name and the first seed, or the rest of one that was
    /// interrupted. Returns the path of the last model's checkpoint.
    ///
    /// # Errors
    /// An unknown method, or as [`Session::carry_out`].
    pub fn run_alone(
        &self,
        method: &str,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<PathBuf, ExperimentError> {
        let Some(method) = self.method(method) else {
            let known: Vec<&str> = self
                .methods
                .iter()
                .map(|m| m.config.name.as_str())
                .collect();
            return Err(self.config.wrong(format!(
                "it has no method `{method}`; choose from {}",
                known.join(", ")
            )));
        };
        let mut resolved = self.resolved();
        resolved["method"] = json!(method.config.name);
        folder.claim(&self.identity("mbrl", resolved))?;
        let run = self.run_of(method, self.first_seed, folder);
        let learnt = method.learn(&run, folder.clone(), observer);
        let failed = |source| ExperimentError::Run {
            method: method.config.name.clone(),
            seed: self.first_seed,
            source,
        };
        Ok(learnt.map_err(failed)?.checkpoint)
    }

    fn method(&self, name: &str) -> Option<&Method> {
        self.methods
            .iter()
            .find(|method| method.config.name == name)
    }

    /// Whether a method has a prior of this kind.
    pub(super) fn has_prior(&self, is_such: impl Fn(&Prior) -> bool) -> bool {
        let mut methods = self.methods.iter();
        methods.any(|method| is_such(&method.learner.prior))
    }

    pub(super) fn identity(&self, command: &str, config: Value) -> Identity {
        let inputs = self.methods.iter().flat_map(|method| &method.inputs);
        Identity {
            command: command.to_owned(),
            seed: self.first_seed,
            config,
            inputs: inputs
                .map(|(path, hash)| (path.display().to_string(), hash.clone()))
                .collect(),
        }
    }

    /// The configuration with everything that it names.
    pub(super) fn resolved(&self) -> Value {
        json!({
            "config": self.config,
            "task": self.task,
            "plant": self.plant.description().map_or_else(|| self.truth(), |plant| json!({"name": plant.name})),
            "device": self.backend.name(),
        })
    }

    /// The plant's own equations, as far as they are known.
    fn truth(&self) -> Value {
        self.truth.as_ref().map_or(Value::Null, |plant| {
            json!({
                "model": plant.system.declaration,
                "parameters": plant.parameters,
                "effects": plant.effects.iter().map(effect).collect::<Vec<_>>(),
            })
        })
    }

    pub(super) fn seeds(&self) -> Vec<u64> {
        let numbers = 0..self.config.seeds;
        numbers.map(|k| self.first_seed.wrapping_add(k)).collect()
    }

    pub(super) fn run_of<'a>(
        &'a self,
        method: &'a Method,
        seed: u64,
        folder: &RunFolder,
    ) -> Run<'a> {
        Run {
            task: &self.task,
            plant: &self.plant,
            learner: &method.learner,
            schedule: Schedule {
                random: self.config.random,
                gather: self.config.gather,
                rounds: method.config.rounds,
            },
            seed,
            folder: folder.path().to_owned(),
        }
    }
}

/// An effect of a plant: name, joint, values.
fn effect(effect: &FittedEffect) -> Value {
    let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
    json!([effect.effect.name, effect.joint, values])
}
