use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Lab, Trial};
use crate::experiment::ExperimentError;
use crate::recipe::first_difference;
use crate::report::write_whole;

/// Where trials are kept: `runs/CASE-SEED.json`.
pub(super) struct Runs {
    dir: PathBuf,
}

/// A trial, with all that decides it.
#[derive(Serialize, Deserialize)]
struct Kept {
    config: Value,
    trial: Trial,
}

impl Runs {
    pub fn open(dir: &Path) -> Result<Self, ExperimentError> {
        let dir = dir.join("runs");
        fs::create_dir_all(&dir).map_err(|error| wrong(&dir, error.to_string()))?;
        Ok(Self { dir })
    }

    /// The trial that lies here, or else a new one, which then does.
    pub fn get_or(
        &self,
        lab: &Lab,
        case: usize,
        seed: u64,
        new: impl FnOnce() -> Result<Trial, ExperimentError>,
    ) -> Result<Trial, ExperimentError> {
        let name = &lab.experiment.cases[case].name;
        let path = self.dir.join(format!("{name}-{seed}.json"));
        let config = config(lab, case);
        if path.is_file() {
            return read(&path, &config);
        }
        let trial = new()?;
        let kept = Kept { config, trial };
        let text = serde_json::to_string_pretty(&kept).expect("numbers and texts") + "\n";
        write_whole(&path, text.as_bytes())?;
        Ok(kept.trial)
    }
}

fn read(path: &Path, config: &Value) -> Result<Trial, ExperimentError> {
    let remedy = "remove it, or give another folder with --out";
    let unreadable = |error: String| wrong(path, format!("{error}; {remedy}"));
    let text = fs::read_to_string(path).map_err(|error| unreadable(error.to_string()))?;
    let kept: Kept = serde_json::from_str(&text).map_err(|error| unreadable(error.to_string()))?;
    match first_difference("trial", &kept.config, config) {
        Some(difference) => Err(ExperimentError::Other {
            dir: path.to_owned(),
            difference,
        }),
        None => Ok(kept.trial),
    }
}

/// All that decides a trial beside its seed.
fn config(lab: &Lab, case: usize) -> Value {
    let experiment = &lab.experiment;
    json!({
        "declaration": lab.declared.declaration,
        "task": lab.task,
        "case": experiment.cases[case],
        "episodes": experiment.episodes,
        "network": experiment.network,
        "fit": experiment.fit,
        "device": lab.backend.name(),
    })
}

fn wrong(path: &Path, message: String) -> ExperimentError {
    ExperimentError::File {
        path: path.to_owned(),
        message,
    }
}
