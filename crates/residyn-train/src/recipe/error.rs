use std::path::PathBuf;

use crate::{CheckpointError, HybridError, SegmentsError, TrainError};
use residyn_core::data::LogError;
use residyn_core::model::{FileError, ModelError};
use residyn_core::plant::PlantError;
use residyn_io::runs::RunFolderError;

/// Why a recipe cannot be carried out.
#[derive(Debug, thiserror::Error)]
pub enum RecipeError {
    #[error("{path}: cannot be read: {source}", path = .path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
    /// Weights of the penalty were given to a recipe that cannot use them.
    #[error("{path}: {reason}", path = .path.display())]
    NoAlpha { path: PathBuf, reason: &'static str },
    #[error("{path}: [data]: {source}", path = .path.display())]
    Plant { path: PathBuf, source: PlantError },
    #[error("{path}: {source}", path = .path.display())]
    Segments {
        path: PathBuf,
        source: SegmentsError,
    },
    #[error("{path}: `model` does not match the checkpoint: {source}", path = .path.display())]
    OtherModel {
        path: PathBuf,
        source: Box<CheckpointError>,
    },
    #[error("{0}")]
    Folder(#[from] RunFolderError),
    #[error(transparent)]
    Model(#[from] FileError),
    #[error(transparent)]
    Measured(#[from] ModelError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Hybrid(#[from] HybridError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("{0}")]
    Train(#[from] TrainError),
}
