use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::RecipeError;
use super::data::{Data, Logged};
use crate::{FitSettings, LearningRates};
use residyn_core::expr::suggestion;
use residyn_core::model::{Dynamics, LastLayer, MlpSettings};
use residyn_core::sim::Integrator;
use residyn_core::toml_text::from_toml;
use residyn_io::files::read_text;

const TUNING_EPOCHS: usize = 500;
const TUNING_RATE: f64 = 0.003;

/// What to train, from which start, on which data, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// A model file, relative to the recipe, or the name of a built-in system.
    pub model: PathBuf,
    pub kind: Kind,
    /// Physical parameters to hold at their values, in addition to those that the model file fixes.
    #[serde(default)]
    pub hold: Vec<String>,
    /// Initial values that differ from those of the model file.
    #[serde(default)]
    pub start: BTreeMap<String, f64>,
    pub data: Data,
    /// The network F_r (or F, if the model is a network alone); the model file's settings if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<MlpSettings>,
    #[serde(default)]
    pub fit: FitSettings,
    /// The file that the recipe was read from.
    #[serde(skip)]
    pub path: PathBuf,
}

/// The parts of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Equations and a residual network: F = F_p + F_r.
    Hybrid,
    /// Equations alone.
    Physics,
    /// A network alone.
    DataDriven,
}

impl Kind {
    /// The name in recipes and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hybrid => "hybrid",
            Self::Physics => "physics",
            Self::DataDriven => "data_driven",
        }
    }

    /// Initial weights of the last layer of its network.
    pub(super) fn last_layer(self) -> LastLayer {
        match self {
            Self::Hybrid | Self::Physics => LastLayer::Zero,
            Self::DataDriven => LastLayer::Random,
        }
    }
}

impl Recipe {
    /// Read a recipe.
    ///
    /// # Errors
    /// An unreadable file, an unknown key, contradictory values: with line and remedy.
    pub fn read(path: &Path) -> Result<Self, RecipeError> {
        let text = read_text(path).map_err(|source| RecipeError::Open {
            path: path.to_owned(),
            source,
        })?;
        Self::from_text(path, &text)
    }

    /// Parses the recipe in `text`; file names in it are relative to `path`.
    ///
    /// # Errors
    /// As [`Recipe::read`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, RecipeError> {
        Self::located(path, from_toml(text))
    }

    /// The recipe in `json`, with the keys of a recipe file; file names in it are relative to the working directory.
    ///
    /// # Errors
    /// As [`Recipe::read`], without lines.
    pub fn from_json(json: &str) -> Result<Self, RecipeError> {
        Self::located(Path::new("recipe"), serde_json::from_str(json))
    }

    /// The recipe, if it was read, located at this file and checked.
    fn located(path: &Path, read: Result<Self, impl Display>) -> Result<Self, RecipeError> {
        let wrong = |message: String| RecipeError::File {
            path: path.to_owned(),
            message,
        };
        let mut recipe = read.map_err(|error| wrong(error.to_string()))?;
        path.clone_into(&mut recipe.path);
        recipe.check().map_err(wrong)?;
        Ok(recipe)
    }

    /// The recipe for fine-tuning a model of `system` on logs: segments and integrator suit finely and irregularly
    /// sampled rigs, and the learning rates are low enough to keep what the model has learnt.
    pub fn for_logs(system: &str, logs: Vec<PathBuf>) -> Self {
        Self {
            model: system.into(),
            kind: Kind::Hybrid,
            hold: Vec::new(),
            start: BTreeMap::new(),
            data: Data::Logged(Logged::usual(logs)),
            network: None,
            fit: FitSettings {
                epochs: TUNING_EPOCHS,
                learning_rates: LearningRates {
                    physics: TUNING_RATE,
                    prior: TUNING_RATE,
                    residual: TUNING_RATE,
                },
                integrator: Integrator::RK4,
                ..FitSettings::default()
            },
            path: PathBuf::new(),
        }
    }

    /// Refuses settings that would be silently ignored.
    fn check(&self) -> Result<(), String> {
        if self.kind == Kind::Physics && self.network.is_some() {
            return Err(
                "[network] is given, but kind = \"physics\" has no network; remove it, or use kind = \
                 \"hybrid\""
                    .into(),
            );
        }
        let given = !self.start.is_empty() || !self.hold.is_empty();
        if self.kind == Kind::DataDriven && given {
            return Err(
                "[start] and `hold` concern physical parameters, but kind = \"data_driven\" has none; remove them, \
                 or use kind = \"hybrid\""
                    .into(),
            );
        }
        Ok(())
    }

    /// Apply `[start]` and `hold`.
    pub(super) fn set_parameters(&self, dynamics: &mut Dynamics) -> Result<(), RecipeError> {
        for (name, value) in &self.start {
            let k = self.find("[start]", name, dynamics)?;
            dynamics.parameters[k].value = *value;
        }
        for name in &self.hold {
            let k = self.find("`hold`", name, dynamics)?;
            dynamics.parameters[k].fixed = true;
        }
        Ok(())
    }

    fn find(&self, place: &str, name: &str, dynamics: &Dynamics) -> Result<usize, RecipeError> {
        let known: Vec<&str> = dynamics
            .parameters
            .iter()
            .map(|p| p.name.as_str())
            .collect();
        known.iter().position(|k| *k == name).ok_or_else(|| {
            let near = suggestion(name, known.iter().copied());
            self.wrong(format!(
                "{place} names `{name}`, which is not a parameter of {}{near}; it has {}",
                dynamics.name,
                known.join(", ")
            ))
        })
    }

    pub(super) fn wrong(&self, message: String) -> RecipeError {
        RecipeError::File {
            path: self.path.clone(),
            message,
        }
    }
}
