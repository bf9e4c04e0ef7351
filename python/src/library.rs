use std::path::PathBuf;

use pyo3::prelude::*;
use residyn::{Library as Known, with_effects_in};

use crate::error::OrRaise;
use crate::model::Model;

/// The effects that a model may lack: `Library()` has the built-in ones.
///
/// A library does not change: `with_folder` and `with_effect` return a new one. `name in library` says whether it has an
/// effect, `len(library)` how many it has.
#[pyclass(frozen, module = "residyn")]
pub struct Library(pub Known);

#[pymethods]
#[allow(clippy::needless_pass_by_value)] // arguments from Python become owned values
impl Library {
    #[new]
    fn new() -> Self {
        Self(Known::built_in())
    }

    /// The library with the effect files of a folder (`*.toml`) as well.
    ///
    /// Args:
    ///     path: the folder. An effect of a known name replaces the known one.
    ///
    /// Returns:
    ///     The larger library.
    ///
    /// Raises:
    ///     ResidynError: a folder that cannot be read, or a file that is not an effect, with line, column and remedy.
    fn with_folder(&self, path: PathBuf) -> PyResult<Self> {
        let more = with_effects_in(&path, self.0.clone());
        more.or_raise_at(&path).map(Self)
    }

    /// The library with one more effect.
    ///
    /// Args:
    ///     text: what an effect file holds. An effect of a known name replaces the known one.
    ///
    /// Returns:
    ///     The larger library.
    ///
    /// Raises:
    ///     ResidynError: a text that is not an effect, with line, column and remedy.
    fn with_effect(&self, text: &str) -> PyResult<Self> {
        Ok(Self(self.0.clone().with_effect(text.parse().or_raise()?)))
    }

    /// Names of the effects, in alphabetical order.
    #[getter]
    fn effects(&self) -> Vec<String> {
        let effects = self.0.effects().iter();
        effects.map(|effect| effect.name.clone()).collect()
    }

    /// As `Model.read` with this library.
    ///
    /// Args:
    ///     path: a file, or one of `residyn.names("systems")`.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ResidynError: with file, line and column, what is wrong and what to do.
    fn model(&self, path: PathBuf) -> PyResult<Model> {
        Model::of_library(self.0.clone(), &path)
    }

    fn __len__(&self) -> usize {
        self.0.effects().len()
    }

    fn __contains__(&self, name: &str) -> bool {
        self.0.effect(name).is_ok()
    }

    fn __repr__(&self) -> String {
        format!("<residyn.Library: {} effects>", self.0.effects().len())
    }
}

/// The effects that a model may lack, as functions take them.
#[derive(FromPyObject)]
pub enum Effects<'py> {
    Library(PyRef<'py, Library>),
    Folders(Vec<PathBuf>),
}

impl Default for Effects<'_> {
    fn default() -> Self {
        Self::Folders(Vec::new())
    }
}

impl Effects<'_> {
    /// The effects of a library, or the built-in effects and those of folders.
    pub fn library(self) -> PyResult<Known> {
        match self {
            Self::Library(library) => Ok(library.0.clone()),
            Self::Folders(folders) => {
                let with = |known: Known, folder: PathBuf| {
                    with_effects_in(&folder, known).or_raise_at(&folder)
                };
                folders.into_iter().try_fold(Known::built_in(), with)
            }
        }
    }
}
