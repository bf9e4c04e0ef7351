use std::path::Path;

use serde_json::json;

use super::session::{Observer, equations};
use super::{Config, ExperimentError, MethodConfig};
use crate::control::Predictor;
use crate::mbrl::{Folder, Learner, Prior, Round, Run, RunError};
use crate::model::{Dynamics, Library, Origin, System};
use crate::sim::Integrator;
use crate::train::{Backend, Checkpoint, HybridModel};

/// A method with all that it names read.
pub(super) struct Method {
    pub config: MethodConfig,
    pub learner: Learner,
    /// What the model file beside its weights says, and its text.
    dynamics: Dynamics,
    model_toml: String,
}

/// What came of a method with one seed.
pub(super) struct Learnt {
    pub rounds: Vec<Round>,
    /// After the last round.
    pub model: HybridModel,
}

/// A round that is done.
#[derive(Debug, Clone, Copy)]
pub struct Step<'s> {
    pub method: &'s str,
    pub seed: u64,
    pub round: &'s Round,
    /// Whether it was found done.
    pub found: bool,
}

impl Method {
    pub(super) fn read(
        method: &MethodConfig,
        config: &Config,
        plant: &System,
        library: &Library,
        backend: Backend,
    ) -> Result<Self, ExperimentError> {
        let mut model_toml = plant.declaration.clone();
        let mut dynamics = equations(plant);
        let prior = if let Some(file) = &method.model {
            let system = library.system(&config.beside_or_named(file))?;
            dynamics = equations(&system);
            model_toml.clone_from(&system.declaration);
            Prior::Equations(Box::new(dynamics.clone()))
        } else if let Some(dir) = &method.checkpoint {
            let checkpoint = Checkpoint::load(&config.beside_or_named(dir))?;
            let model = checkpoint.model(&dynamics, &backend.device())?;
            model_toml.clone_from(&checkpoint.model_toml);
            Prior::Trained(Box::new(model))
        } else {
            Prior::Nothing
        };
        if dynamics.joints != plant.joints {
            return Err(config.wrong(format!(
                "method `{}`: its model has {} joints, the plant {}",
                method.name, dynamics.joints, plant.joints
            )));
        }
        Ok(Self {
            learner: Learner {
                system: plant.name.clone(),
                joints: plant.joints,
                prior,
                network: method.network.clone(),
                fit: method.fit.clone(),
                backend,
            },
            config: method.clone(),
            dynamics,
            model_toml,
        })
    }

    /// What it plans with before it has seen anything; none where it knows nothing.
    pub(super) fn prior(&self, integrator: Integrator) -> Result<Option<Predictor>, RunError> {
        let model = self.learner.untrained()?;
        Ok(model.map(|model| model.predictor(integrator)))
    }

    /// What it plans with once it has learnt.
    pub(super) fn predictor(&self, model: &HybridModel) -> Predictor {
        model.predictor(self.config.fit.integrator)
    }

    /// Do what is left of a run in `dir`.
    pub(super) fn learn(
        &self,
        run: &Run<'_>,
        dir: &Path,
        observer: Observer<'_>,
    ) -> Result<Learnt, RunError> {
        let mut folder = Folder::open(dir)?;
        let told = |round: &Round, found: bool| {
            observer(&Step {
                method: &self.config.name,
                seed: run.seed,
                round,
                found,
            });
        };
        for round in folder.rounds() {
            told(round, true);
        }
        let mut progress = folder.progress(run, &self.dynamics)?;
        while progress.rounds < self.config.rounds {
            let (round, training) = run.round(&mut progress)?;
            let origin = Origin {
                config: json!({
                    "command": "mbrl",
                    "method": self.config,
                    "task": run.task,
                    "schedule": run.schedule,
                    "round": round.round,
                }),
                seed: run.seed,
                model_toml: self.model_toml.clone(),
            };
            folder.keep(round.clone(), &progress, &training, &origin)?;
            told(&round, false);
        }
        Ok(Learnt {
            rounds: folder.rounds().to_vec(),
            model: progress.model.expect("there is a round"),
        })
    }
}
