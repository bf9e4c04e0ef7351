//! The compiled half of the Python package: `residyn._residyn`, on which the modules in `python/residyn` are built.

mod arrays;
mod close_loop;
mod control;
mod error;
mod library;
mod log;
mod model;
mod monitor;
mod rig;
mod train;
mod work;

/// The compiled classes and functions behind the package.
#[pyo3::pymodule]
mod _residyn {
    use std::ffi::OsString;
    use std::path::PathBuf;

    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::close_loop::{Outcome, close_loop, stages};
    #[pymodule_export]
    use crate::control::{Episode, control};
    #[pymodule_export]
    use crate::error::ResidynError;
    #[pymodule_export]
    use crate::library::Library;
    #[pymodule_export]
    use crate::log::{Log, read_log};
    #[pymodule_export]
    use crate::model::{Model, Parameter};
    #[pymodule_export]
    use crate::monitor::Monitor;
    #[pymodule_export]
    use crate::rig::{Rig, simulate};

    #[pymodule_export]
    use crate::train::{train, tune};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        residyn::cli::tell_of_panics();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// Run the command line.
    ///
    /// Args:
    ///     file: the file of this module.
    ///     arguments: the words, the name of the program first.
    ///
    /// Returns:
    ///     The exit status.
    #[pyfunction]
    fn main(py: Python<'_>, file: PathBuf, arguments: Vec<OsString>) -> u8 {
        py.detach(|| residyn::cli::run_from(file, arguments))
    }

    /// Names of what is built in.
    ///
    /// Args:
    ///     of: "systems", "plants", "tasks", "effects", "drives" or "formats".
    ///
    /// Returns:
    ///     The names.
    ///
    /// Raises:
    ///     ResidynError: an unknown kind.
    #[pyfunction]
    fn names(of: &str) -> PyResult<Vec<String>> {
        let library = residyn::Library::built_in();
        let owned = |names: Vec<&str>| names.into_iter().map(str::to_owned).collect();
        Ok(match of {
            "systems" => residyn::Library::system_names(),
            "plants" => owned(residyn_core::plant::Plant::names()),
            "tasks" => owned(residyn_control::control::Task::names()),
            "effects" => (library.effects().iter())
                .map(|effect| effect.name.clone())
                .collect(),
            "drives" => (residyn::Library::drives().into_iter())
                .map(|drive| drive.name)
                .collect(),
            "formats" => (residyn_formats::FORMATS.iter())
                .map(|format| format.name.to_owned())
                .collect(),
            _ => {
                return Err(ResidynError::new_err(format!(
                    "there are no {of:?}; ask for systems, plants, tasks, effects, drives or formats"
                )));
            }
        })
    }
}
