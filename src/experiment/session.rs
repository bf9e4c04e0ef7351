use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::learning::{Learnt, Method, Step};
use super::results::{Course, PERFECT, PRIOR, Results};
use super::{Config, ExperimentError, offline_prior, physics_prior, receding_horizon};
use crate::control::{Predictor, Task};
use crate::mbrl::{Judged, Run, Schedule};
use crate::model::{Library, System};
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

/// An experiment with all that it names read: ready to be carried out, or to go on.
pub struct Session {
    pub experiment: Experiment,
    pub config: Config,
    pub(super) task: Task,
    pub(super) plant: Plant,
    pub(super) methods: Vec<Method>,
    out: PathBuf,
    /// As resolved.
    resolved: Value,
}

const CONFIG: &str = "experiment.json";

impl Experiment {
    pub const ALL: [Self; 3] = [
        Self::PhysicsPrior,
        Self::OfflinePrior,
        Self::RecedingHorizon,
    ];

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
    /// Read what `config` names, and look into `out` for what is there already.
    ///
    /// # Errors
    /// Files that cannot be read or do not belong together, or an `out` with another experiment.
    pub fn open(
        experiment: Experiment,
        config: Config,
        out: &Path,
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
        let resolved = json!({
            "experiment": experiment.name(),
            "config": config,
            "task": task,
            "device": backend.name(),
        });
        let session = Self {
            experiment,
            config,
            task,
            plant,
            methods,
            out: out.to_owned(),
            resolved,
        };
        experiment
            .check(&session)
            .map_err(|message| session.config.wrong(message))?;
        session.claim()?;
        Ok(session)
    }

    /// Trainings of all methods and seeds.
    pub fn rounds(&self) -> usize {
        let each = self.methods.iter().map(|method| method.config.rounds);
        self.seeds().count() * each.sum::<usize>()
    }

    /// Carry it out, or go on with it; `observer` is told of every round, those found done included.
    ///
    /// # Errors
    /// A run that diverges, or files that cannot be read or written.
    pub fn run(&self, observer: &(dyn Fn(&Step<'_>) + Sync)) -> Result<Results, ExperimentError> {
        match self.experiment {
            Experiment::PhysicsPrior | Experiment::OfflinePrior => self.learning_curves(observer),
            Experiment::RecedingHorizon => receding_horizon::run(self, observer),
        }
    }

    /// The return of every method against the real transitions that it has seen.
    fn learning_curves(
        &self,
        observer: &(dyn Fn(&Step<'_>) + Sync),
    ) -> Result<Results, ExperimentError> {
        let learnt = self.learn(observer)?;
        let mut results = self.results();
        for (method, runs) in self.methods.iter().zip(&learnt) {
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
        Ok(results)
    }

    /// Train every method with every seed: `[method][seed]`.
    pub(super) fn learn(
        &self,
        observer: &(dyn Fn(&Step<'_>) + Sync),
    ) -> Result<Vec<Vec<Learnt>>, ExperimentError> {
        let of_seed = |seed| self.methods.iter().map(move |method| (method, seed));
        let units: Vec<(&Method, u64)> = self.seeds().flat_map(of_seed).collect();
        let learnt: Vec<Learnt> = (units.into_par_iter().with_max_len(1))
            .map(|(method, seed)| self.learn_one(method, seed, observer))
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
        observer: &(dyn Fn(&Step<'_>) + Sync),
    ) -> Result<Learnt, ExperimentError> {
        let dir = self
            .out
            .join("runs")
            .join(format!("{}-{seed:02}", method.config.name));
        let learnt = method.learn(&self.run_of(method, seed), &dir, &self.resolved, observer);
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
        let seeds: Vec<u64> = self.seeds().collect();
        let judge = |seed: u64| {
            let run = self.run_of(&self.methods[0], seed);
            #[allow(clippy::cast_possible_truncation)] // few seeds
            let judged = run.judge(&predictor(seed as usize), replan);
            judged.map_err(|source| ExperimentError::Run {
                method: method.to_owned(),
                seed,
                source,
            })
        };
        seeds.into_par_iter().with_max_len(1).map(judge).collect()
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
        let mut dynamics = self.plant.dynamics();
        for (parameter, value) in dynamics.parameters.iter_mut().zip(self.plant.values()) {
            parameter.value = value;
        }
        Predictor::of_equations(dynamics, self.task.integrator)
    }

    pub(super) fn results(&self) -> Results {
        Results::new(
            self.experiment.name(),
            &self.task.name(),
            self.seeds().collect(),
            self.resolved.clone(),
        )
    }

    fn seeds(&self) -> std::ops::Range<u64> {
        0..self.config.seeds
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

    /// Say in `out` what is done there, or find that it is this.
    fn claim(&self) -> Result<(), ExperimentError> {
        let path = self.out.join(CONFIG);
        let failed = |error: std::io::Error| ExperimentError::File {
            path: path.clone(),
            message: error.to_string(),
        };
        std::fs::create_dir_all(&self.out).map_err(failed)?;
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let saved: Value = serde_json::from_str(&text).map_err(|e| failed(e.into()))?;
                match first_difference("experiment", &saved, &self.resolved) {
                    Some(difference) => Err(ExperimentError::Other {
                        dir: self.out.clone(),
                        difference,
                    }),
                    None => Ok(()),
                }
            }
            Err(_) => {
                let text = serde_json::to_string_pretty(&self.resolved).expect("a JSON value");
                Ok(write_whole(&path, (text + "\n").as_bytes())?)
            }
        }
    }
}

/// The equations of a system with their declared values.
pub(super) fn equations(system: &System) -> crate::model::Dynamics {
    system.dynamics(&system.sign())
}
