use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Experiment, Results, Session, Trial};
use crate::experiment::ExperimentError;
use residyn_io::runs::{Identity, RunFolder, Shard};
use residyn_plants::Controlled;

/// The contents of `runs/CASE-SEED.json`: a trial and the case that it belongs to.
#[derive(Serialize, Deserialize)]
struct Kept {
    run: Identity,
    trial: Trial,
}

impl Session {
    /// Carries out the trials that are not in the folder yet. `observer` is called after each trial.
    ///
    /// # Errors
    /// A trial that cannot be carried out, or a folder that cannot be written or holds another run.
    pub fn run(
        &self,
        folder: &RunFolder,
        observer: &(impl Fn(&Trial) + Sync),
    ) -> Result<Results, ExperimentError> {
        let trials = self.run_shard(Shard::WHOLE, folder, observer)?;
        Ok(self.results(&trials))
    }

    /// The results of all trials.
    pub fn results(&self, trials: &[Trial]) -> Results {
        Results::new(&self.experiment, trials)
    }

    /// As [`Session::run`], for a shard of the trials.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn run_shard(
        &self,
        shard: Shard,
        folder: &RunFolder,
        observer: &(impl Fn(&Trial) + Sync),
    ) -> Result<Vec<Trial>, ExperimentError> {
        folder.claim(&self.identity())?;
        let runs = folder.within("runs");
        let trials: Vec<(usize, u64)> = shard.share(self.trials()).collect();
        let trial = |&(case, seed): &(usize, u64)| {
            let trial = self.trial_in(&runs, case, seed)?;
            observer(&trial);
            Ok(trial)
        };
        match self.plants.iter().any(Controlled::is_single) {
            true => trials.iter().map(trial).collect(),
            false => trials.par_iter().map(trial).collect(),
        }
    }

    /// The case and the seed of each trial.
    pub fn trials(&self) -> impl Iterator<Item = (usize, u64)> {
        let cases = 0..self.experiment.cases.len();
        cases.flat_map(move |case| {
            (0..self.experiment.seeds).map(move |k| (case, self.first_seed.wrapping_add(k)))
        })
    }

    /// What determines the numbers of all trials together.
    pub fn run_of_all(&self) -> Identity {
        let Identity { config, .. } = self.identity();
        let Experiment { cases, seeds, .. } = &self.experiment;
        self.identity_of(json!({"of_each": config, "cases": cases, "seeds": seeds}))
    }

    /// The settings that all trials share. Cases and seeds are not among them, so that more can be added later.
    fn identity(&self) -> Identity {
        let experiment = &self.experiment;
        self.identity_of(json!({
            "declaration": self.declared.declaration,
            "task": self.task,
            "episodes": experiment.episodes,
            "network": experiment.network,
            "fit": experiment.fit,
            "device": self.backend.name(),
        }))
    }

    fn identity_of(&self, config: Value) -> Identity {
        Identity {
            command: "undeclared-effect".to_owned(),
            seed: self.first_seed,
            config,
            inputs: [].into(),
        }
    }

    /// The trial saved in `folder`; a new one is carried out and saved there.
    fn trial_in(
        &self,
        folder: &RunFolder,
        case: usize,
        seed: u64,
    ) -> Result<Trial, ExperimentError> {
        let case_config = &self.experiment.cases[case];
        let name = format!("{}-{seed}.json", case_config.name);
        let run = self.identity_of(json!({"case": case_config}));
        if let Some(kept) = folder.read::<Kept>(&name)? {
            folder.expect(&kept.run, &run)?;
            return Ok(kept.trial);
        }
        let trial = self.trial(case, seed)?;
        let kept = Kept { run, trial };
        folder.write(&name, &kept)?;
        Ok(kept.trial)
    }
}
