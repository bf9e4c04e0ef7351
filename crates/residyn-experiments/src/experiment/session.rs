use std::path::PathBuf;

use serde_json::{Value, json};

use super::learning::{Method, Observer};
use super::{Config, ExperimentError};
use crate::mbrl::{Prior, Run, Schedule};
use residyn_control::control::Task;
use residyn_core::model::{FittedEffect, Library};
use residyn_core::plant::Plant;
use residyn_io::files::beside_or_named;
use residyn_io::read_plant;
use residyn_io::runs::{Identity, RunFolder, Shard};
use residyn_train::Backend;

/// A configuration with everything it refers to read.
pub struct Session {
    pub config: Config,
    pub(super) task: Task,
    pub(super) plant: Plant,
    pub(super) methods: Vec<Method>,
    backend: Backend,
    first_seed: u64,
}

impl Session {
    /// Reads everything that `config` refers to. The seeds are `first_seed` and those that follow.
    ///
    /// # Errors
    /// Files that cannot be read or do not match.
    pub fn open(
        config: Config,
        library: &Library,
        backend: Backend,
        first_seed: u64,
    ) -> Result<Self, ExperimentError> {
        let task = Task::read(&beside_or_named(&config.path, &config.task))?;
        let plant = read_plant(&beside_or_named(&config.path, &config.plant), library)?;
        if plant.system.name != task.system || plant.system.joints != task.joints() {
            return Err(config.wrong(format!(
                "the task {} is for {}, but the plant is {}; name a plant of that system",
                task.name(),
                task.system,
                plant.system.name
            )));
        }
        if task.steps % config.gather != 0 {
            return Err(config.wrong(format!(
                "`gather` is {}, but an episode of {} has {} steps; choose a divisor of it",
                config.gather,
                task.name(),
                task.steps
            )));
        }
        let methods = (config.method.iter())
            .map(|method| Method::read(method, &config, &plant.system, library, backend))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            config,
            task,
            plant,
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
        let run = self.run_of(method, self.first_seed);
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
            "plant": {
                "model": self.plant.system.declaration,
                "parameters": self.plant.parameters,
                "effects": self.plant.effects.iter().map(effect).collect::<Vec<_>>(),
            },
            "device": self.backend.name(),
        })
    }

    pub(super) fn seeds(&self) -> Vec<u64> {
        let numbers = 0..self.config.seeds;
        numbers.map(|k| self.first_seed.wrapping_add(k)).collect()
    }

    pub(super) fn run_of<'a>(&'a self, method: &'a Method, seed: u64) -> Run<'a> {
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
        }
    }
}

/// An effect of a plant: name, joint, values.
fn effect(effect: &FittedEffect) -> Value {
    let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
    json!([effect.effect.name, effect.joint, values])
}
