use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::ExperimentError;
use residyn_core::limits::RUNS;
use residyn_core::model::{Library, MlpSettings, Model};
use residyn_core::plant::Plant;
use residyn_core::toml_text::from_toml;
use residyn_io::files::{beside_or_named, read_text};
use residyn_io::{read_model, read_plant};
use residyn_plants::Controlled;
use residyn_train::FitSettings;
use residyn_train::recipe::RecipeError;

/// The configuration of an experiment: methods, task and plant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// A task file, relative to this file, or the name of a built-in task.
    pub task: PathBuf,
    /// A plant file, relative to this file, or the name of a built-in plant; or a plant in another process.
    pub plant: PathBuf,
    /// The true equations of a plant in another process, where they are known: a plant or model file, relative to this file,
    /// or the name of a built-in one. Without them no perfect model is compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub perfect: Option<PathBuf>,
    /// Number of consecutive seeds; each method is repeated with each of them.
    pub seeds: u64,
    /// Transitions under random torques, before the first training.
    pub random: usize,
    /// Transitions T under control between two trainings.
    pub gather: usize,
    /// Receding horizons to compare, in steps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub replan: Vec<usize>,
    /// The methods that learn.
    pub method: Vec<MethodConfig>,
    /// The file that it was read from.
    #[serde(skip)]
    pub path: PathBuf,
}

/// A method that learns from the plant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodConfig {
    pub name: String,
    /// The equations of its prior: a model file, relative to this file, or the name of a built-in system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// The trained model that is its prior: a checkpoint, relative to this file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<PathBuf>,
    /// Number of trainings.
    pub rounds: usize,
    /// The network that is added to the prior or, without a prior, is the whole model.
    pub network: MlpSettings,
    #[serde(default)]
    pub fit: FitSettings,
}

impl Config {
    /// Read a configuration.
    ///
    /// # Errors
    /// An unreadable file, an unknown key, a value out of range: with place and remedy.
    pub fn read(path: &Path) -> Result<Self, ExperimentError> {
        let mut config: Self = read_toml(path)?;
        path.clone_into(&mut config.path);
        config.check().map_err(|message| config.wrong(message))?;
        Ok(config)
    }

    /// The equations of `plant`, if they are known.
    pub(super) fn truth(
        &self,
        plant: &Controlled,
        library: &Library,
    ) -> Result<Option<Plant>, ExperimentError> {
        match (plant, &self.perfect) {
            (Controlled::Simulated(simulation), None) => Ok(Some(simulation.plant.clone())),
            (Controlled::Simulated(_), Some(_)) => {
                let fault = "`perfect` is for a plant in another process; this one has its equations in `plant`";
                Err(self.wrong(fault.into()))
            }
            (Controlled::Elsewhere(_), Some(file)) => Ok(Some(read_plant(
                &beside_or_named(&self.path, file),
                library,
            )?)),
            (Controlled::Elsewhere(_), None) => Ok(None),
        }
    }

    /// The equations of the first method that has some, for a plant that says nothing of its own.
    pub(super) fn declared(&self, library: &Library) -> Result<Model, ExperimentError> {
        let mut files = self
            .method
            .iter()
            .filter_map(|method| method.model.as_ref());
        let file = files.next().ok_or_else(|| {
            let fault = "a plant in another process says nothing of its equations; give a method a `model`, or name `perfect`";
            self.wrong(fault.into())
        })?;
        Ok(read_model(beside_or_named(&self.path, file), library)?)
    }

    pub(super) fn wrong(&self, message: String) -> ExperimentError {
        ExperimentError::file(&self.path, message)
    }

    fn check(&self) -> Result<(), String> {
        let rounds = self.method.iter().map(|method| ("rounds", method.rounds));
        let mut counts = [
            ("seeds", usize::try_from(self.seeds).unwrap_or(usize::MAX)),
            ("random", self.random),
            ("gather", self.gather),
            ("[[method]]", self.method.len()),
        ]
        .into_iter()
        .chain(rounds);
        if let Some((name, found)) = counts.find(|(_, count)| !(1..=RUNS).contains(count)) {
            return Err(format!("`{name}` must be from 1 to {RUNS}, found {found}"));
        }
        for (k, method) in self.method.iter().enumerate() {
            let name = &method.name;
            let sound = |c: char| c.is_ascii_alphanumeric() || c == '_';
            if name.is_empty() || !name.chars().all(sound) {
                return Err(format!(
                    "the method name {name:?} becomes a folder name; use letters, digits and _"
                ));
            }
            if [super::PRIOR, super::PERFECT].contains(&name.as_str())
                || self.method[..k].iter().any(|other| other.name == *name)
            {
                return Err(format!(
                    "the method name `{name}` is already taken; choose another"
                ));
            }
            if method.model.is_some() && method.checkpoint.is_some() {
                return Err(format!(
                    "method `{name}` has both `model` and `checkpoint`; give one of them as its prior"
                ));
            }
        }
        Ok(())
    }
}

/// Reads a configuration in TOML.
pub(super) fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, ExperimentError> {
    let text = read_text(path).map_err(|source| RecipeError::Open {
        path: path.to_owned(),
        source,
    })?;
    from_toml(&text).map_err(|error| ExperimentError::file(path, error.to_string()))
}
