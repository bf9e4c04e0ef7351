use std::path::PathBuf;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::learning::{Learnt, Method, Step};
use super::results::{Course, PERFECT, PRIOR, Results};
use super::{Config, ExperimentError, offline_prior, physics_prior, receding_horizon};
use crate::control::{Predictor, Task};
use crate::files::beside_or_named;
use crate::mbrl::{Judge, Judged, Prior, Run, Schedule};
use crate::model::{FittedEffect, Library, Model};
use crate::plant::Plant;
use crate::runs::{Identity, RunFolder};
use crate::train::Backend;

/// The published experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    PhysicsPrior,
    OfflinePrior,
    RecedingHorizon,
}

/// A configuration with everything it refers to read.
pub struct Session {
    pub config: Config,
    pub(super) task: Task,
    pub(super) plant: Plant,
    pub(super) methods: Vec<Method>,
    backend: Backend,
    first_seed: u64,
}

/// Called after every round, including those that were carried out before.
pub type Observer<'o> = &'o (dyn Fn(&Step<'_>) + Sync);

impl Experiment {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::PhysicsPrior => physics_prior::NAME,
            Self::OfflinePrior => offline_prior::NAME,
            Self::RecedingHorizon => receding_horizon::NAME,
        }
    }

    fn check(self, session: &Session) -> Result<(), String> {
        match self {
            Self::PhysicsPrior => physics_prior::check(session),
            Self::OfflinePrior => offline_prior::check(session),
            Self::RecedingHorizon => receding_horizon::check(session),
        }
    }
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
        let plant = Plant::read(&beside_or_named(&config.path, &config.plant), library)?;
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

    /// Number of trainings of all methods and seeds.
    pub fn rounds(&self) -> usize {
        let each = self.methods.iter().map(|method| method.config.rounds);
        self.seeds().len() * each.sum::<usize>()
    }

    /// Number of trainings of one run of a method; 0 for an unknown method.
    pub fn rounds_of(&self, method: &str) -> usize {
        self.method(method).map_or(0, |known| known.config.rounds)
    }

    /// Carries out an experiment in its folder, or the rest of one that was interrupted.
    ///
    /// # Errors
    /// A configuration of another experiment, the folder of another run, a run that diverges, or files that cannot be read
    /// or written.
    pub fn carry_out(
        &self,
        experiment: Experiment,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<Results, ExperimentError> {
        experiment
            .check(self)
            .map_err(|message| self.config.wrong(message))?;
        let run = self.identity(experiment.name(), self.resolved());
        folder.claim(&run)?;
        let learnt = self.learn(folder, observer)?;
        let (name, task) = (experiment.name(), self.task.name());
        let mut results = Results::new(name, &task, self.seeds(), run.config);
        match experiment {
            Experiment::PhysicsPrior | Experiment::OfflinePrior => {
                self.learning_curves(&learnt, &mut results)?;
            }
            Experiment::RecedingHorizon => receding_horizon::compare(self, &learnt, &mut results)?,
        }
        Ok(results)
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
        let learnt = self.learn_one(method, self.first_seed, folder.clone(), observer)?;
        Ok(learnt.checkpoint)
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

    fn identity(&self, command: &str, config: Value) -> Identity {
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

    fn resolved(&self) -> Value {
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

    /// Evaluates the return of every method against the number of real transitions.
    fn learning_curves(
        &self,
        learnt: &[Vec<Learnt>],
        results: &mut Results,
    ) -> Result<(), ExperimentError> {
        for (method, runs) in self.methods.iter().zip(learnt) {
            let rounds = (0..method.config.rounds).map(|round| {
                let judged = runs
                    .iter()
                    .map(|run| run.rounds[round].judged.clone())
                    .collect();
                (runs[0].rounds[round].transitions, judged)
            });
            results
                .methods
                .insert(method.config.name.clone(), rounds.collect());
        }
        let replan = self.task.replan;
        for (name, predictor) in self.fixed()? {
            let judged = self.judge_all(|_| predictor.clone(), replan, name)?;
            results
                .methods
                .insert(name.to_owned(), Course::from_iter([(0, judged)]));
        }
        Ok(())
    }

    /// Trains every method with every seed: `[method][seed]`.
    fn learn(
        &self,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<Vec<Vec<Learnt>>, ExperimentError> {
        let seeds = self.seeds().into_iter();
        let units: Vec<(&Method, u64)> = seeds
            .flat_map(|seed| self.methods.iter().map(move |method| (method, seed)))
            .collect();
        let learn = |(method, seed): (&Method, u64)| {
            let own = folder.within(format!("runs/{}-{seed:02}", method.config.name));
            self.learn_one(method, seed, own, observer)
        };
        let learnt: Vec<Learnt> = units
            .into_par_iter()
            .with_max_len(1)
            .map(learn)
            .collect::<Result<_, _>>()?;
        let mut by_method: Vec<Vec<Learnt>> = self.methods.iter().map(|_| Vec::new()).collect();
        for (unit, run) in learnt.into_iter().enumerate() {
            by_method[unit % self.methods.len()].push(run);
        }
        Ok(by_method)
    }

    fn learn_one(
        &self,
        method: &Method,
        seed: u64,
        folder: RunFolder,
        observer: Observer<'_>,
    ) -> Result<Learnt, ExperimentError> {
        let learnt = method.learn(&self.run_of(method, seed), folder, observer);
        learnt.map_err(|source| ExperimentError::Run {
            method: method.config.name.clone(),
            seed,
            source,
        })
    }

    /// Evaluates a model for each seed; `predictor` is given the seed's position, from 0.
    pub(super) fn judge_all(
        &self,
        predictor: impl Fn(usize) -> Predictor + Sync,
        replan: usize,
        method: &str,
    ) -> Result<Vec<Judged>, ExperimentError> {
        let judge = |(k, seed): (usize, u64)| {
            let judge = Judge {
                task: &self.task,
                plant: &self.plant,
                seed,
            };
            let judged = judge.judge(&predictor(k), replan);
            judged.map_err(|source| ExperimentError::Run {
                method: method.to_owned(),
                seed,
                source,
            })
        };
        self.seeds()
            .into_par_iter()
            .enumerate()
            .with_max_len(1)
            .map(judge)
            .collect()
    }

    /// The methods that do not learn.
    pub(super) fn fixed(&self) -> Result<Vec<(&'static str, Predictor)>, ExperimentError> {
        let mut fixed = vec![(PERFECT, self.perfect())];
        for method in &self.methods {
            if let Some(prior) = method.prior(self.task.integrator)? {
                fixed.push((PRIOR, prior));
                break;
            }
        }
        Ok(fixed)
    }

    /// The plant's own equations, integrated as those of models are.
    fn perfect(&self) -> Predictor {
        Predictor::of_equations(self.plant.dynamics(), self.task.integrator)
    }

    fn seeds(&self) -> Vec<u64> {
        (self.first_seed..)
            .zip(0..self.config.seeds)
            .map(|(seed, _)| seed)
            .collect()
    }

    fn run_of<'a>(&'a self, method: &'a Method, seed: u64) -> Run<'a> {
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

/// The equations of a system with the declared values.
pub(super) fn equations(system: &Model) -> crate::model::Dynamics {
    system.dynamics()
}
