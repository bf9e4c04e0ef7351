use std::path::PathBuf;

use thiserror::Error;

use crate::closeloop::StudyError;
use crate::control::TaskError;
use crate::mbrl::RunError;
use crate::model::FileError;
use crate::plant::PlantError;
use crate::report::plot::PlotError;
use crate::runs::RunFolderError;
use crate::train::{CheckpointError, HybridError};

/// Why an experiment cannot be carried out.
#[derive(Debug, Error)]
pub enum ExperimentError {
    #[error("{path}: cannot be read: {source}", path = .path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
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
    #[error("{0}")]
    Learner(#[from] RunError),
    #[error(transparent)]
    Task(#[from] TaskError),
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Model(#[from] FileError),
    #[error(transparent)]
    Hybrid(#[from] HybridError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("{0}")]
    Folder(#[from] RunFolderError),
    #[error(transparent)]
    Plot(#[from] PlotError),
}
