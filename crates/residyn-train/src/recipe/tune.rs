use std::path::{Path, PathBuf};

use serde_json::json;

use super::job::{declared, new_network};
use super::{Job, Kind, Recipe, RecipeError, TrainingData};
use crate::{Backend, Checkpoint};
use residyn_core::model::{LastLayer, Library, Model, Origin};

impl Job {
    /// Fine-tunes the model of a checkpoint on the recipe's data.
    ///
    /// All parameters of the checkpoint's model are trained further, at the recipe's rates. With `kind = "hybrid"`, a
    /// model without a residual gets one that is initially zero, so that the checkpoint serves as F_p; an existing
    /// residual is trained further. The other kinds add nothing and must match the checkpoint.
    ///
    /// # Errors
    /// As [`Job::train`], or a checkpoint of another system or kind.
    pub fn tune(
        checkpoint: &Checkpoint,
        recipe: Recipe,
        library: &Library,
        backend: Backend,
        seed: u64,
    ) -> Result<Self, RecipeError> {
        if !recipe.start.is_empty() || !recipe.hold.is_empty() {
            return Err(recipe.wrong(
                "[start] and `hold` are for training from scratch; when tuning, the checkpoint \
                 determines them; remove them"
                    .into(),
            ));
        }
        // Used only to refuse a checkpoint of another system: the equations are the ones saved with the weights.
        let meant = declared(&recipe, library)?.0.dynamics();
        let refused = |source| RecipeError::OtherModel {
            path: recipe.path.clone(),
            source: Box::new(source),
        };
        checkpoint
            .model(&meant, &backend.device())
            .map_err(refused)?;
        tuned(checkpoint, recipe, library, backend, seed)
    }

    /// Fine-tunes the model of a checkpoint on logs with the recipe of [`Recipe::for_logs`].
    ///
    /// # Errors
    /// As [`Job::tune`].
    pub fn tune_on_logs(
        checkpoint: &Checkpoint,
        logs: Vec<PathBuf>,
        library: &Library,
        backend: Backend,
        seed: u64,
    ) -> Result<Self, RecipeError> {
        let recipe = Recipe::for_logs(&checkpoint.manifest.shape.system, logs);
        tuned(checkpoint, recipe, library, backend, seed)
    }
}

fn tuned(
    checkpoint: &Checkpoint,
    recipe: Recipe,
    library: &Library,
    backend: Backend,
    seed: u64,
) -> Result<Job, RecipeError> {
    let declared = beside(checkpoint, library)?;
    let dynamics = declared.dynamics();
    let prior = checkpoint.model(&dynamics, &backend.device())?;
    let data = TrainingData::load(&recipe, &declared, library, seed)?;
    let residual = || new_network(&recipe, &declared, &data, seed, LastLayer::Zero);
    let model = match (recipe.kind, kind_of(checkpoint)) {
        (asked, saved) if asked == saved => prior,
        (Kind::Hybrid, _) => prior.with_residual(&residual())?,
        (asked, saved) => return Err(other_kind(&recipe, asked, saved)),
    };
    let manifest = &checkpoint.manifest;
    let config = json!({
        "command": "tune",
        "recipe": recipe,
        "data": data.training.fingerprint(),
        "device": backend.name(),
        "from": {"config": manifest.config, "seed": manifest.seed, "epoch": manifest.epoch},
    });
    Ok(Job {
        recipe,
        data,
        model,
        origin: Origin {
            config,
            seed,
            model_toml: checkpoint.model_toml.clone(),
            call: None,
        },
        dynamics,
    })
}

/// The model file of a checkpoint.
fn beside(checkpoint: &Checkpoint, library: &Library) -> Result<Model, RecipeError> {
    let name = Path::new("the checkpoint's model.toml");
    Ok(Model::from_text(
        name,
        &checkpoint.model_toml,
        library.effects(),
    )?)
}

fn kind_of(checkpoint: &Checkpoint) -> Kind {
    let weights = &checkpoint.weights;
    match (&weights.prior, &weights.residual) {
        (_, Some(_)) => Kind::Hybrid,
        (Some(_), None) => Kind::DataDriven,
        (None, None) => Kind::Physics,
    }
}

fn other_kind(recipe: &Recipe, asked: Kind, saved: Kind) -> RecipeError {
    recipe.wrong(format!(
        "kind = \"{}\", but the checkpoint holds a model of kind \"{}\"; use that, or \"hybrid\"",
        asked.name(),
        saved.name()
    ))
}
