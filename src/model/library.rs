use std::path::{Path, PathBuf};

use include_dir::{Dir, include_dir};

use super::effect::Effect;
use super::reader::FileError;
use super::ready_drive::ReadyDrive;
use super::system::Model;

static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/models");

/// The effects and systems known by name: the embedded ones and a user's own.
#[derive(Debug, Clone)]
pub struct Library {
    effects: Vec<Effect>,
    probes: Vec<Effect>,
}

impl Library {
    /// The embedded effects and systems.
    ///
    /// # Panics
    /// Never: a test reads every embedded file.
    pub fn built_in() -> Self {
        Self {
            effects: embedded("effects", Effect::from_text),
            probes: embedded("probes", Effect::from_text),
        }
    }

    /// A library without effects and probes, in which nothing can be found.
    pub const fn empty() -> Self {
        Self {
            effects: Vec::new(),
            probes: Vec::new(),
        }
    }

    /// Add every `*.toml` of a folder; an effect of a known name replaces the known one.
    ///
    /// # Errors
    /// Unreadable folder, or the first error in a file.
    pub fn with_folder(mut self, folder: &Path) -> Result<Self, FileError> {
        for path in effect_files(folder)? {
            let effect = Effect::read(&path)?;
            self.effects.retain(|known| known.name != effect.name);
            self.effects.push(effect);
        }
        self.effects.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(self)
    }

    /// All effects, by name.
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// Generic functions of one variable without a physical name. They are fitted to the residual, to test whether it
    /// depends on that variable.
    pub fn probes(&self) -> &[Effect] {
        &self.probes
    }

    /// The effect of this name.
    ///
    /// # Errors
    /// Unknown name, with the nearest known one.
    pub fn effect(&self, name: &str) -> Result<&Effect, String> {
        Effect::find(&self.effects, name)
    }

    /// The embedded drives, by name.
    ///
    /// # Panics
    /// Never: a test reads every embedded file.
    pub fn drives() -> Vec<ReadyDrive> {
        embedded("drives", ReadyDrive::from_text)
    }

    /// Names of the embedded systems.
    pub fn system_names() -> Vec<String> {
        let mut names: Vec<String> = BUILT_IN
            .files()
            .filter(|file| is_toml(file.path()))
            .filter_map(|file| Some(file.path().file_stem()?.to_str()?.to_owned()))
            .collect();
        names.sort();
        names
    }

    /// The text of an embedded system.
    pub fn system_text(name: &str) -> Option<&'static str> {
        BUILT_IN.get_file(format!("{name}.toml"))?.contents_utf8()
    }

    /// A system from a file or, where there is no such file, an embedded one of that name.
    ///
    /// # Errors
    /// As [`Model::read`]; for a path that is neither, with the names of all embedded systems.
    pub fn model(&self, path: impl AsRef<Path>) -> Result<Model, FileError> {
        let path = path.as_ref();
        let embedded = path
            .to_str()
            .filter(|_| !path.is_file())
            .and_then(Self::system_text);
        if let Some(text) = embedded {
            return Model::from_text(path, text, &self.effects);
        }
        Model::read(path, &self.effects).map_err(|mut error| {
            let within = path.join("model.toml");
            if within.is_file() {
                error.message += &format!("; give {}", within.display());
            } else if error.place.is_none() {
                error.message += &format!(
                    "; give a model file or one of {}",
                    Self::system_names().join(", ")
                );
            }
            error
        })
    }
}

/// The embedded files of one folder, by name.
fn embedded<T>(folder: &str, read: impl Fn(&Path, &str) -> Result<T, FileError>) -> Vec<T> {
    let files = BUILT_IN
        .get_dir(folder)
        .expect("the folder is embedded")
        .files();
    let mut files: Vec<_> = files.filter(|file| is_toml(file.path())).collect();
    files.sort_by_key(|file| file.path());
    let whole = files.into_iter().map(|file| {
        let text = file.contents_utf8().expect("embedded files are UTF-8");
        read(file.path(), text).expect("embedded files are read by a test")
    });
    whole.collect()
}

/// The effect files of a folder, by name.
///
/// # Errors
/// Unreadable folder.
pub fn effect_files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let unreadable = |error: std::io::Error| FileError {
        path: folder.to_owned(),
        place: None,
        message: format!("cannot be read as a folder of effects: {error}"),
    };
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(unreadable)?;
    paths.retain(|path| is_toml(path));
    paths.sort();
    Ok(paths)
}

fn is_toml(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

#[cfg(test)]
mod tests {
    use super::Library;
    use std::path::Path;

    #[test]
    fn every_embedded_file_is_valid() {
        let library = Library::built_in();
        assert!(library.effects().len() >= 13);
        for name in Library::system_names() {
            library.model(Path::new(&name)).unwrap();
        }
        assert!(Library::drives().len() >= 4);
        for effect in library.effects() {
            for other in effect.contains.iter().chain(&effect.confused_with) {
                let of_system = other == "parameter_shift";
                assert!(
                    of_system || library.effect(other).is_ok(),
                    "{} names {other}",
                    effect.name
                );
            }
        }
    }
}
