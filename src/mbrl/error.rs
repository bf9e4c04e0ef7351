use std::path::PathBuf;

use thiserror::Error;

use crate::data::LogError;
use crate::plant::PlantError;
use crate::report::WriteError;
use crate::train::{CheckpointError, HybridError, SegmentsError, TrainError};

/// Why a run of the loop cannot go on.
#[derive(Debug, Error)]
pub enum RunError {
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(transparent)]
    Model(#[from] HybridError),
    #[error(transparent)]
    Segments(#[from] SegmentsError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A file of an earlier session that does not fit.
    #[error("{path}: {message}", path = .path.display())]
    Saved { path: PathBuf, message: String },
}
