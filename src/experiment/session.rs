use std::path::Path;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::learning::{Learnt, Method, Step};
use super::results::{Course, PERFECT, PRIOR, Results};
use super::{Config, ExperimentError, offline_prior, physics_prior, receding_horizon};
use crate::control::{Predictor, Task};
use crate::mbrl::{Judge, Judged, Prior, Run, Schedule};
use crate::model::{FittedEffect, Library, Model};
use crate::plant::Plant;
use crate::recipe::first_difference;
use crate::report::write_whole;
use crate::train::Backend;

/// The experiments by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    PhysicsPrior,
    OfflinePrior,
    RecedingHorizon,
}

/// A configuration with all that it names read.
pub struct Session {
    pub config: Config,
    pub(super) task: Task,
    pub(super) plant: Plant,
    pub(super) methods: Vec<Method>,
    backend: Backend,
}

/// Who is told of every round, those found done included.
pub type Observer<'o> = &'o (dyn Fn(&Step<'_>) + Sync);

const CONFIG: &str = "experiment.json";

impl Experiment {
    /// The name that the command line takes.
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
    /// Read what `config` names.
    ///
    /// # Errors
    /// Files that cannot be read or do not belong together.
    pub fn open(
        config: Config,
        library: &Library,
        backend: Backend,
    ) -> Result<Self, ExperimentError> {
        let task = Task::read(&config.beside_or_named(&config.task))?;
        let plant = Plant::read(&config.beside_or_named(&config.plant), library)?;
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
        })
    }

    /// Trainings of all methods and seeds.
    pub fn rounds(&self) -> usize {
        let each = self.methods.iter().map(|method| method.config.rounds);
        self.seeds().len() * each.sum::<usize>()
    }

    /// Trainings of one run of a method; 0 where it is unknown.
    pub fn rounds_of(&self, method: &str) -> usize {
        self.method(method).map_or(0, |known| known.config.rounds)
    }

    /// Carry out an experiment in the folder `out`, or go on with it.
    ///
    /// # Errors
    /// A configuration that is not one of this experiment, an `out` that holds another one, a run that diverges, or
    /// files that cannot be read or written.
    pub fn carry_out(
        &self,
        experiment: Experiment,
        out: &Path,
        observer: Observer<'_>,
    ) -> Result<Results, ExperimentError> {
        experiment
            .check(self)
            .map_err(|message| self.config.wrong(message))?;
        let resolved = self.resolved(experiment.name());
        claim(out, &resolved)?;
        let learnt = self.learn(out, observer)?;
        let mut results =
            Results::new(experiment.name(), &self.task.name(), self.seeds(), resolved);
        match experiment {
            Experiment::PhysicsPrior | Experiment::OfflinePrior => {
                self.learning_curves(&learnt, &mut results)?;
            }
            Experiment::RecedingHorizon => receding_horizon::compare(self, &learnt, &mut results)?,
        }
        Ok(results)
    }

    /// One run of the loop, with the method of this name, in the folder `dir`; or what is left of it.
    ///
    /// # Errors
    /// An unknown method, a `dir` that holds another run, or as [`Session::carry_out`].
    pub fn run_alone(
        &self,
        method: &str,
        seed: u64,
        dir: &Path,
        observer: Observer<'_>,
    ) -> Result<(), ExperimentError> {
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
        let mut resolved = self.resolved("none");
        resolved["seed"] = json!(seed);
        resolved["method"] = json!(method.config.name);
        claim(dir, &resolved)?;
        self.learn_one(method, seed, dir, observer).map(drop)
    }

    fn method(&self, name: &str) -> Option<&Method> {
        self.methods
            .iter()
            .find(|method| method.config.name == name)
    }

    /// Whether one of the methods has such a prior.
    pub(super) fn has_prior(&self, is_such: impl Fn(&Prior) -> bool) -> bool {
        let mut methods = self.methods.iter();
        methods.any(|method| is_such(&method.learner.prior))
    }

    fn resolved(&self, experiment: &str) -> Value {
        json!({
            "experiment": experiment,
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

    /// The return of every method against the real transitions that it has seen.
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

    /// Train every method with every seed: `[method][seed]`.
    fn learn(
        &self,
        out: &Path,
        observer: Observer<'_>,
    ) -> Result<Vec<Vec<Learnt>>, ExperimentError> {
        let seeds = self.seeds().into_iter();
        let units: Vec<(&Method, u64)> = seeds
            .flat_map(|seed| self.methods.iter().map(move |method| (method, seed)))
            .collect();
        let learn = |(method, seed): (&Method, u64)| {
            let dir = out
                .join("runs")
                .join(format!("{}-{seed:02}", method.config.name));
            self.learn_one(method, seed, &dir, observer)
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
        dir: &Path,
        observer: Observer<'_>,
    ) -> Result<Learnt, ExperimentError> {
        let learnt = method.learn(&self.run_of(method, seed), dir, observer);
        learnt.map_err(|source| ExperimentError::Run {
            method: method.config.name.clone(),
            seed,
            source,
        })
    }

    /// An episode with the model of each seed.
    pub(super) fn judge_all(
        &self,
        predictor: impl Fn(usize) -> Predictor + Sync,
        replan: usize,
        method: &str,
    ) -> Result<Vec<Judged>, ExperimentError> {
        let judge = |seed: u64| {
            let judge = Judge {
                task: &self.task,
                plant: &self.plant,
                seed,
            };
            #[allow(clippy::cast_possible_truncation)] // few seeds
            let judged = judge.judge(&predictor(seed as usize), replan);
            judged.map_err(|source| ExperimentError::Run {
                method: method.to_owned(),
                seed,
                source,
            })
        };
        self.seeds()
            .into_par_iter()
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

    /// The plant's own equations, stepped as models are.
    fn perfect(&self) -> Predictor {
        Predictor::of_equations(self.plant.dynamics(), self.task.integrator)
    }

    fn seeds(&self) -> Vec<u64> {
        (0..self.config.seeds).collect()
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

/// Say in `dir` what is done there, or find that it is this.
fn claim(dir: &Path, resolved: &Value) -> Result<(), ExperimentError> {
    let path = dir.join(CONFIG);
    let failed = |error: std::io::Error| ExperimentError::File {
        path: path.clone(),
        message: error.to_string(),
    };
    std::fs::create_dir_all(dir).map_err(failed)?;
    let Ok(text) = std::fs::read_to_string(&path) else {
        let text = serde_json::to_string_pretty(resolved).expect("a JSON value");
        return Ok(write_whole(&path, (text + "\n").as_bytes())?);
    };
    let saved: Value = serde_json::from_str(&text).map_err(|error| failed(error.into()))?;
    match first_difference("experiment", &saved, resolved) {
        Some(difference) => Err(ExperimentError::Other {
            dir: dir.to_owned(),
            difference,
        }),
        None => Ok(()),
    }
}

/// The equations of a system with their declared values.
pub(super) fn equations(system: &Model) -> crate::model::Dynamics {
    system.dynamics()
}
