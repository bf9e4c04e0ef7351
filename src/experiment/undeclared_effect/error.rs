use std::path::PathBuf;

use thiserror::Error;

use crate::closeloop::StudyError;
use crate::control::TaskError;
use crate::mbrl::RunError;
use crate::model::FileError;
use crate::report::WriteError;

/// Why the experiment cannot be carried out.
#[derive(Debug, Error)]
pub enum ExperimentError {
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
    #[error(transparent)]
    Model(#[from] FileError),
    #[error(transparent)]
    Task(#[from] TaskError),
    #[error("{case}, seed {seed}: {source}")]
    Run {
        case: String,
        seed: u64,
        source: Box<RunError>,
    },
    #[error("{case}, seed {seed}: {source}")]
    Study {
        case: String,
        seed: u64,
        source: Box<StudyError>,
    },
    #[error(transparent)]
    Write(#[from] WriteError),
}
