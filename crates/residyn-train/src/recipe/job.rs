use serde_json::{Value, json};

use super::data::Data;
use super::{Kind, Recipe, RecipeError, TrainingData};
use crate::{Backend, Checkpoint, HybridModel, Training};
use residyn_core::model::{Dynamics, LastLayer, Library, MlpSettings, MlpWeights, Model, Origin};
use residyn_core::streams::{Purpose, stream};
use residyn_io::files::{beside_or_named, content_id, text_or_embedded};
use residyn_io::read_model;
use residyn_io::runs::{Identity, RunFolder};

/// A recipe with everything it refers to, read or sampled: ready to train or to resume.
pub struct Job {
    pub recipe: Recipe,
    pub data: TrainingData,
    /// The model before training.
    pub model: HybridModel,
    /// The origin that the run's checkpoints record.
    pub origin: Origin,
    /// The equations of the model file, for resuming.
    pub(super) dynamics: Dynamics,
}

/// The configuration's key for the command line that repeats the run.
const COMMAND_LINE: &str = "command_line";

impl Job {
    /// Prepares training from scratch.
    ///
    /// # Errors
    /// A recipe, model, plant or log that cannot be read, or that do not match.
    pub fn train(
        recipe: Recipe,
        library: &Library,
        backend: Backend,
        seed: u64,
    ) -> Result<Self, RecipeError> {
        let (declared, model_toml) = declared(&recipe, library)?;
        let mut dynamics = declared.dynamics();
        recipe.set_parameters(&mut dynamics)?;
        let data = TrainingData::load(&recipe, &declared, library, seed)?;
        let last = recipe.kind.last_layer();
        let network = || new_network(&recipe, &declared, &data, seed, last);
        let device = backend.device();
        let model = match recipe.kind {
            Kind::Physics => HybridModel::physics(&dynamics, &device)?,
            Kind::Hybrid => HybridModel::physics(&dynamics, &device)?.with_residual(&network())?,
            Kind::DataDriven => {
                HybridModel::network(&declared.name, declared.joints, &network(), &device)?
            }
        };
        let config = json!({
            "command": "train",
            "recipe": recipe,
            "data": data.training.fingerprint(),
            "device": backend.name(),
        });
        Ok(Self {
            recipe,
            data,
            model,
            origin: Origin {
                config,
                seed,
                model_toml,
                call: None,
            },
            dynamics,
        })
    }

    /// Records the command line that repeats this run.
    #[must_use]
    pub fn begun_by(mut self, command_line: String) -> Self {
        self.origin.config[COMMAND_LINE] = command_line.into();
        self
    }

    /// Starts the training, or resumes it from the checkpoint in `folder`.
    ///
    /// # Errors
    /// The folder holds something else, or the checkpoint of another run.
    pub fn begin(&self, folder: &RunFolder) -> Result<Training, RecipeError> {
        let Some(checkpoint) = Checkpoint::find(folder.path())? else {
            let order = stream(self.origin.seed, Purpose::RecipeOrder);
            let settings = self.recipe.fit.clone();
            return Ok(Training::new(self.model.clone(), settings, order)?);
        };
        let saved = &checkpoint.manifest;
        folder.expect(
            &identity(&saved.config, saved.seed, &checkpoint.model_toml),
            &self.identity(),
        )?;
        Ok(checkpoint.training(&self.dynamics, &self.model.device())?)
    }

    /// Everything that determines the training's numbers.
    pub fn identity(&self) -> Identity {
        let Origin {
            config,
            seed,
            model_toml,
            ..
        } = &self.origin;
        identity(config, *seed, model_toml)
    }
}

/// The identity of a training, from what its checkpoints record.
fn identity(config: &Value, seed: u64, model_toml: &str) -> Identity {
    let mut config = config.clone();
    let mut take = |key: &str| config.as_object_mut().and_then(|all| all.remove(key));
    let text = |value: Option<Value>| value.as_ref().and_then(Value::as_str).map(str::to_owned);
    // The spelling of the command does not matter.
    take(COMMAND_LINE);
    let (command, data) = (text(take("command")), text(take("data")));
    let inputs = [
        ("a log or the plant", data.unwrap_or_default()),
        ("the model file", content_id(model_toml.as_bytes())),
    ];
    Identity {
        command: command.unwrap_or_default(),
        seed,
        config,
        inputs: inputs.map(|(name, hash)| (name.to_owned(), hash)).into(),
    }
}

/// The recipe's model and the text of its file.
pub(super) fn declared(recipe: &Recipe, library: &Library) -> Result<(Model, String), RecipeError> {
    let path = beside_or_named(&recipe.path, &recipe.model);
    let model = read_model(&path, library)?;
    match &recipe.data {
        Data::Logged(_) => model.runs_without_logs("a trained model")?,
        // Its trajectories begin anywhere, and what the states of effects are there is not known.
        Data::Simulated(_) => model.stands_alone("a model trained on a simulated plant")?,
    }
    let text = text_or_embedded(&path, Library::system_text)
        .map_err(|source| RecipeError::Open { path, source })?;
    Ok((model, text.into_owned()))
}

/// The network of the recipe or, if it gives none, of the model file.
pub(super) fn new_network(
    recipe: &Recipe,
    model: &Model,
    data: &TrainingData,
    seed: u64,
    last: LastLayer,
) -> MlpWeights {
    let settings = recipe.network.clone().unwrap_or_else(|| MlpSettings {
        hidden: model.hidden.clone(),
        ..MlpSettings::for_joints(model.joints)
    });
    let mut rng = stream(seed, Purpose::RecipeNetwork);
    data.training.network(&settings, last, &mut rng)
}
