use std::path::PathBuf;

use serde_json::json;

use super::{Config, ExperimentError, MethodConfig};
use crate::mbrl::{Folder, Learner, Prior, Round, Run, RunError};
use residyn_control::control::Predictor;
use residyn_core::model::{Dynamics, Library, Model, ModelError, Origin};
use residyn_core::sim::Integrator;
use residyn_io::files::{beside, beside_or_named, content_id};
use residyn_io::read_model;
use residyn_io::runs::RunFolder;
use residyn_train::{Backend, Checkpoint, HybridModel};

/// A method with everything it refers to read.
pub(super) struct Method {
    pub config: MethodConfig,
    pub learner: Learner,
    /// The equations of the model file that is saved with its weights, and the file's text.
    dynamics: Dynamics,
    model_toml: String,
    /// The files of its prior and hashes of their contents.
    pub inputs: Vec<(PathBuf, String)>,
}

/// The result of a method with one seed.
pub(super) struct TrainedMethod {
    pub rounds: Vec<Round>,
    /// After the last round.
    pub model: HybridModel,
    /// The checkpoint of that model.
    pub checkpoint: PathBuf,
}

/// A finished round.
#[derive(Debug, Clone, Copy)]
pub struct FinishedRound<'s> {
    pub method: &'s str,
    pub seed: u64,
    pub round: &'s Round,
    /// Whether it was carried out before, by a run that was interrupted.
    pub found: bool,
}

/// Called after every round, including those that were carried out before.
pub type Observer<'o> = &'o (dyn Fn(&FinishedRound<'_>) + Sync);

impl Method {
    pub(super) fn read(
        method: &MethodConfig,
        config: &Config,
        plant: &Model,
        library: &Library,
        backend: Backend,
    ) -> Result<Self, ExperimentError> {
        let mut model_toml = plant.declaration.clone();
        let mut inputs = Vec::new();
        let mut dynamics = plant.dynamics();
        let prior = if let Some(file) = &method.model {
            let model = read_model(beside_or_named(&config.path, file), library)?;
            let refused = |error: ModelError| config.wrong(error.to_string());
            model.stands_alone("an experiment").map_err(refused)?;
            dynamics = model.dynamics();
            model_toml.clone_from(&model.declaration);
            inputs.push((file.clone(), content_id(model_toml.as_bytes())));
            Prior::Equations(Box::new(dynamics.clone()))
        } else if let Some(dir) = &method.checkpoint {
            let checkpoint = Checkpoint::load(&beside(&config.path, dir))?;
            let model = checkpoint.model(&dynamics, &backend.device())?;
            model_toml.clone_from(&checkpoint.model_toml);
            inputs.push((dir.clone(), checkpoint.fingerprint()));
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
            inputs,
        })
    }

    /// Whether it starts from a model.
    pub(super) fn has_prior(&self) -> bool {
        !matches!(self.learner.prior, Prior::Nothing)
    }

    /// The model it plans with before training, which it must have.
    pub(super) fn prior(&self, integrator: Integrator) -> Result<Predictor, RunError> {
        let model = self.learner.untrained()?;
        Ok(model.expect("it has a prior").predictor(integrator))
    }

    /// The model it plans with after training.
    pub(super) fn predictor(&self, model: &HybridModel) -> Predictor {
        model.predictor(self.config.fit.integrator)
    }

    /// Carries out the remaining rounds of a run in its folder.
    pub(super) fn learn(
        &self,
        run: &Run<'_>,
        folder: RunFolder,
        observer: Observer<'_>,
    ) -> Result<TrainedMethod, RunError> {
        let mut folder = Folder::open(folder)?;
        let report = |round: &Round, found: bool| {
            observer(&FinishedRound {
                method: &self.config.name,
                seed: run.seed,
                round,
                found,
            });
        };
        for round in folder.rounds() {
            report(round, true);
        }
        let mut state = folder.state(run, &self.dynamics)?;
        while state.rounds < self.config.rounds {
            let (round, training) = run.round(&mut state)?;
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
                call: None,
            };
            folder.keep(round.clone(), &state, &training, &origin)?;
            report(&round, false);
        }
        Ok(TrainedMethod {
            rounds: folder.rounds().to_vec(),
            checkpoint: folder.checkpoint(),
            model: state.model.expect("there is a round"),
        })
    }
}
