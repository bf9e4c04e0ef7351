use std::path::Path;

use thiserror::Error;

use crate::mbrl::RunError;
use residyn_control::control::TaskError;
use residyn_core::closeloop::StudyError;
use residyn_core::model::FileError;
use residyn_core::plant::PlantError;
use residyn_io::runs::RunFolderError;
use residyn_plants::ControlledError;
use residyn_train::CheckpointError;
use residyn_train::recipe::RecipeError;

/// Why an experiment cannot be carried out.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// A configuration, model, checkpoint or run folder that cannot be used.
    #[error(transparent)]
    Recipe(#[from] RecipeError),
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
    Model(#[from] FileError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("{0}")]
    Folder(#[from] RunFolderError),
    #[error(transparent)]
    Task(#[from] TaskError),
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error("{0}")]
    Controlled(#[from] ControlledError),
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
