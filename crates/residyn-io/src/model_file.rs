//! Models and effects as files.

use std::path::{Path, PathBuf};

use residyn_core::model::{Effect, FileError, Library, Model};

use crate::files::{listed, read_text};

/// Reads a model from a file or, if there is no such file, takes the embedded one of that name. Its effects are looked
/// up in the library.
///
/// # Errors
/// Unreadable file, unknown or missing key, formula error, unknown effect: with line, column and remedy. For a path that is
/// neither, with the names of all embedded systems.
pub fn read_model(path: impl AsRef<Path>, library: &Library) -> Result<Model, FileError> {
    let path = path.as_ref();
    let embedded = path.to_str().filter(|_| !path.is_file());
    if let Some(text) = embedded.and_then(Library::system_text) {
        return Model::from_text(path, text, library.effects());
    }
    let read = |text: String| Model::from_text(path, &text, library.effects());
    text(path).and_then(read).map_err(|mut error| {
        let within = path.join("model.toml");
        if within.is_file() {
            error.message += &format!("; give {}", within.display());
        } else if error.place.is_none() {
            let known = Library::system_names().join(", ");
            error.message += &format!("; give a model file or one of {known}");
        }
        error
    })
}

/// Reads one effect file.
///
/// # Errors
/// Unreadable file, unknown or missing key, formula error: with line, column and remedy.
pub fn read_effect(path: &Path) -> Result<Effect, FileError> {
    Effect::from_text(path, &text(path)?)
}

/// The library with every `*.toml` of a folder; an effect of a known name replaces the known one.
///
/// # Errors
/// Unreadable folder, or the first error in a file.
pub fn with_effects_in(folder: &Path, library: Library) -> Result<Library, FileError> {
    let mut paths = effect_files(folder)?.into_iter();
    paths.try_fold(library, |library, path| {
        Ok(library.with_effect(read_effect(&path)?))
    })
}

/// The effect files of a folder, by name.
///
/// # Errors
/// Unreadable folder.
pub fn effect_files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let unreadable = |error: std::io::Error| {
        let message = format!("cannot be read as a folder of effects: {error}");
        FileError::new(folder, None, message)
    };
    let mut paths = listed(folder).map_err(unreadable)?;
    paths.retain(|path| path.extension() == Some("toml".as_ref()));
    Ok(paths)
}

fn text(path: &Path) -> Result<String, FileError> {
    let unreadable = |error| FileError::new(path, None, format!("cannot be read: {error}"));
    read_text(path).map_err(unreadable)
}
