use std::path::PathBuf;

use thiserror::Error;

use crate::closeloop::StudyError;
use crate::control::TaskError;
use crate::mbrl::RunError;
use crate::model::FileError;
use crate::plant::PlantError;
use crate::report::WriteError;
use crate::report::plot::PlotError;
use crate::train::{CheckpointError, HybridError};

/// Why an experiment cannot be carried out.
#[derive(Debug, Error)]
pub enum ExperimentError {
    #[error("{path}: cannot be read: {source}; give a file with --config", path = .path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
    #[error(
        "{dir} holds another experiment: {difference}; give another folder with --out, or remove this one to start anew",
        dir = .dir.display()
    )]
    Other { dir: PathBuf, difference: String },
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
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Plot(#[from] PlotError),
}
