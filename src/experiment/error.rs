use std::path::Path;

use thiserror::Error;

use crate::closeloop::StudyError;
use crate::control::TaskError;
use crate::mbrl::RunError;
use crate::plant::PlantError;
use crate::report::plot::PlotError;
use crate::train::recipe::RecipeError;

/// Why an experiment cannot be carried out.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// A configuration, model, checkpoint or run folder that cannot be used.
    #[error(transparent)]
    Recipe(RecipeError),
    #[error("{method}, seed {seed}: {source}")]
    Run {
        method: String,
        seed: u64,
        source: RunError,
    },
    #[error("{case}, seed {seed}: {source}")]
    Study {
        case: String,
        seed: u64,
        source: StudyError,
    },
    #[error(transparent)]
    Task(#[from] TaskError),
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Plot(#[from] PlotError),
}

/// From whatever a [`RecipeError`] can be made of.
impl<E: Into<RecipeError>> From<E> for ExperimentError {
    fn from(error: E) -> Self {
        Self::Recipe(error.into())
    }
}

impl ExperimentError {
    /// A configuration that is contradictory or does not match what it names.
    pub(super) fn file(path: &Path, message: String) -> Self {
        Self::Recipe(RecipeError::File {
            path: path.to_owned(),
            message,
        })
    }
}
