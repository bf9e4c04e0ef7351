//! Simulated rigs as files.

use std::path::Path;

use residyn_core::model::{FileError, Library};
use residyn_core::plant::{Plant, PlantError};

use crate::files::{beside_or_named, text_or_embedded};
use crate::model_file::read_model;

/// Reads a plant file, or takes the embedded plant of that name. A model file, or the name of an embedded system, gives
/// the rig that the model declares, with the sensors and excitation of a desktop rig. Model files that a plant names
/// are looked for next to it.
///
/// # Errors
/// Unreadable file, unknown key, parameter or effect, a model that reads measured columns; messages name place and
/// remedy.
pub fn read_plant(path: &Path, library: &Library) -> Result<Plant, PlantError> {
    let plant = match text_or_embedded(path, Plant::embedded) {
        Ok(text) if Plant::is_one(&text) => plant_from_text(path, &text, library)?,
        // A model file, or one that cannot be read, for which the model's reader has the error message.
        _ => Plant::of_system(read_model(path, library).map_err(or_a_plant)?),
    };
    plant.check_measured()?;
    Ok(plant)
}

/// The plant in a text, as if the text stood in a file at `path`.
///
/// # Errors
/// As [`read_plant`].
pub fn plant_from_text(path: &Path, text: &str, library: &Library) -> Result<Plant, PlantError> {
    let model = |named: &Path| read_model(beside_or_named(path, named), library);
    Plant::from_text(path, text, library, model)
}

/// The error for a file that is not a model, for users who may have meant a plant.
fn or_a_plant(mut error: FileError) -> FileError {
    if error.place.is_none() {
        let known = Plant::names().join(", ");
        error.message += &format!("; or a plant file, or one of the plants {known}");
    }
    error
}
