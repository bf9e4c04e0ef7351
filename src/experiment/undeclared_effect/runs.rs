use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Lab, Trial};
use crate::experiment::ExperimentError;
use crate::runs::{Identity, RunFolder};

/// The contents of `runs/CASE-SEED.json`: a trial and the case that it belongs to.
#[derive(Serialize, Deserialize)]
struct Kept {
    run: Identity,
    trial: Trial,
}

impl Lab {
    /// The settings that all trials share. Cases and seeds are not among them, so that more can be added later.
    pub(super) fn identity(&self) -> Identity {
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
    pub(super) fn trial_in(
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
