use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::experiment::{ExperimentError, config};
use residyn_core::model::MlpSettings;
use residyn_core::plant::HiddenEffect;
use residyn_train::FitSettings;

/// The configuration of an experiment: models to compare, and plants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// The declared model: a model file, relative to this file, or the name of a built-in system.
    pub model: PathBuf,
    /// The task: a task file, relative to this file, or the name of a built-in task.
    pub task: PathBuf,
    /// Number of consecutive seeds (of initial states, sensor noise and plans) in each case.
    pub seeds: u64,
    /// Numbers of episodes on whose logs models are closed and trained, in ascending order.
    pub episodes: Vec<usize>,
    /// The plants: what each has that the declared model lacks.
    #[serde(rename = "case")]
    pub cases: Vec<Case>,
    /// The residual network of the hybrid.
    pub network: MlpSettings,
    /// Training of the hybrid.
    pub fit: FitSettings,
    /// The file that it was read from.
    #[serde(skip)]
    pub path: PathBuf,
}

/// A plant: its differences from the declared model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Part of a file's name.
    pub name: String,
    /// True values of declared parameters that differ from the declared ones.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<HiddenEffect>,
    /// The plant itself, in another process; `parameters` and `effects` are then what is known of it. Without it, the plant is
    /// simulated with these.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plant: Option<PathBuf>,
}

impl Experiment {
    /// Read an experiment.
    ///
    /// # Errors
    /// An unreadable file, an unknown key, a value out of range: with line and remedy.
    pub fn read(path: &Path) -> Result<Self, ExperimentError> {
        let mut experiment: Self = config::read_toml(path)?;
        path.clone_into(&mut experiment.path);
        experiment
            .check()
            .map_err(|message| experiment.wrong(message))?;
        Ok(experiment)
    }

    pub(super) fn wrong(&self, message: String) -> ExperimentError {
        ExperimentError::file(&self.path, message)
    }

    fn check(&self) -> Result<(), String> {
        if self.seeds == 0 || self.cases.is_empty() {
            return Err("`seeds` and `case` need at least one each".into());
        }
        let rising = self.episodes.is_sorted_by(|a, b| a < b);
        if !rising || self.episodes.first().is_none_or(|first| *first == 0) {
            return Err("`episodes` must be increasing numbers above zero, such as [1, 3]".into());
        }
        for (k, Case { name, .. }) in self.cases.iter().enumerate() {
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
            if name.is_empty() || !name.chars().all(plain) {
                return Err(format!(
                    "the case name `{name}` becomes part of file names; use letters, digits, - and _"
                ));
            }
            if self.cases[..k].iter().any(|other| other.name == *name) {
                return Err(format!("two cases are called `{name}`; rename one"));
            }
        }
        Ok(())
    }
}
