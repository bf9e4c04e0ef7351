use thiserror::Error;

use crate::data::LogError;
use crate::plant::PlantError;
use crate::runs::RunFolderError;
use crate::train::{CheckpointError, HybridError, SegmentsError, TrainError};

/// Why a run of the loop cannot begin or be resumed.
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
    #[error("{0}")]
    Log(#[from] LogError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("{0}")]
    Folder(#[from] RunFolderError),
}
