use std::path::Path;

use serde_json::json;

use residyn_core::model::Origin;
use residyn_core::rng;
use residyn_formats::Imported;
use residyn_train::{Backend, CheckpointError, FitSettings, HybridModel, Training, save};

/// Writes an exported model as an untrained checkpoint. `seed` orders the minibatches of a training that continues from
/// it.
///
/// # Errors
/// A folder that cannot be written, or that holds something other than a checkpoint.
pub fn save_imported(
    dir: &Path,
    imported: Imported,
    seed: u64,
    backend: Backend,
) -> Result<(), CheckpointError> {
    let Imported {
        description,
        system: declared,
        numbers,
    } = imported;
    let dynamics = declared.dynamics();
    let device = backend.device();
    let model = HybridModel::restored(&description.shape, &numbers, &dynamics, &device)?;
    let settings = FitSettings {
        integrator: description.integrator,
        ..FitSettings::default()
    };
    let training = Training::new(model, settings, rng(seed))?;
    let (step_s, exported) = (description.step_s, description.origin);
    let origin = Origin {
        config: json!({"command": "import", "step_s": step_s, "origin": exported}),
        seed,
        model_toml: description.model_toml,
        call: None,
    };
    save(dir, &training, &origin)
}
