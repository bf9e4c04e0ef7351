use std::path::Path;

use serde_json::json;

use super::difference::first_difference;
use super::material::{Purpose, stream};
use super::{Kind, Material, Recipe, RecipeError};
use crate::expr::SignForm;
use crate::model::{Dynamics, LastLayer, Library, MlpSettings, MlpWeights, Origin, System};
use crate::train::{Backend, Checkpoint, HybridModel, Training};

/// A recipe with all that it names read and drawn: the start of a run, or of its continuation.
pub struct Job {
    pub recipe: Recipe,
    pub material: Material,
    /// The model before training.
    pub model: HybridModel,
    /// For the checkpoints.
    pub origin: Origin,
    /// What the model file says, for the continuation.
    pub(super) dynamics: Dynamics,
}

/// A model file, read, with its text.
pub(super) struct Declared {
    pub system: System,
    pub text: String,
}

impl Job {
    /// Train from scratch.
    ///
    /// # Errors
    /// A recipe, model, plant or log that cannot be read or that do not fit each other.
    pub fn train(
        recipe: Recipe,
        library: &Library,
        backend: Backend,
        seed: u64,
    ) -> Result<Self, RecipeError> {
        let Declared { system, text } = declared(&recipe, library)?;
        let mut dynamics = equations(&system);
        recipe.set_parameters(&mut dynamics)?;
        let material = Material::gather(&recipe, &system, library, seed)?;
        let last = recipe.kind.last_layer();
        let network = || new_network(&recipe, &system, &material, seed, last);
        let device = backend.device();
        let model = match recipe.kind {
            Kind::Physics => HybridModel::physics(&dynamics, &device)?,
            Kind::Hybrid => HybridModel::physics(&dynamics, &device)?.with_residual(&network())?,
            Kind::DataDriven => {
                HybridModel::network(&system.name, system.joints, &network(), &device)?
            }
        };
        let config = json!({
            "command": "train",
            "recipe": recipe,
            "data": fingerprint(&material),
            "device": backend.name(),
        });
        Ok(Self {
            recipe,
            material,
            model,
            origin: Origin {
                config,
                seed,
                model_toml: text,
            },
            dynamics,
        })
    }

    /// The run: new, or where the checkpoint in `dir` left it.
    ///
    /// # Errors
    /// `dir` holds something else, or the checkpoint of another run.
    pub fn begin(&self, dir: &Path) -> Result<Training, RecipeError> {
        let Some(checkpoint) = Checkpoint::find(dir)? else {
            let order = stream(self.origin.seed, Purpose::Order);
            let settings = self.recipe.fit.clone();
            return Ok(Training::new(self.model.clone(), settings, order)?);
        };
        if let Some(difference) = self.difference(&checkpoint) {
            return Err(RecipeError::OtherRun {
                dir: dir.to_owned(),
                difference,
            });
        }
        Ok(checkpoint.training(&self.dynamics, &self.model.device())?)
    }

    /// What tells this run from that of a checkpoint; none where they are the same.
    fn difference(&self, checkpoint: &Checkpoint) -> Option<String> {
        let (saved, mine) = (&checkpoint.manifest, &self.origin);
        let settings = || {
            ["command", "recipe", "device", "from"]
                .into_iter()
                .find_map(|key| first_difference(key, &saved.config[key], &mine.config[key]))
        };
        // Last, since another seed or another recipe changes the data as well.
        let files = || {
            let same_data = saved.config["data"] == mine.config["data"];
            let same_model = checkpoint.model_toml == mine.model_toml;
            match (same_data, same_model) {
                (true, true) => None,
                (false, _) => Some("a log or the plant has changed since".to_owned()),
                (true, false) => Some("the model file has changed since".to_owned()),
            }
        };
        first_difference("seed", &json!(saved.seed), &json!(mine.seed))
            .or_else(settings)
            .or_else(files)
    }
}

pub(super) fn declared(recipe: &Recipe, library: &Library) -> Result<Declared, RecipeError> {
    let path = recipe.beside_or_named(&recipe.model);
    let system = library.system(&path)?;
    let embedded = || path.to_str().and_then(Library::system_text);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(source) => match embedded() {
            Some(text) => text.to_owned(),
            None => return Err(RecipeError::Open { path, source }),
        },
    };
    Ok(Declared { system, text })
}

pub(super) fn equations(system: &System) -> Dynamics {
    system.dynamics(&vec![SignForm::DEFAULT; system.joints])
}

pub(super) fn new_network(
    recipe: &Recipe,
    system: &System,
    material: &Material,
    seed: u64,
    last: LastLayer,
) -> MlpWeights {
    let settings = recipe.network.clone().unwrap_or_else(|| MlpSettings {
        hidden: system.hidden.clone(),
        ..MlpSettings::for_joints(system.joints)
    });
    let scaling = material.training.scaling(settings.angles);
    let mut rng = stream(seed, Purpose::Network);
    MlpWeights::new(system.joints, &settings, scaling, last, &mut rng)
}

pub(super) fn fingerprint(material: &Material) -> String {
    format!("{:016x}", material.training.fingerprint())
}
