use std::path::PathBuf;

use crate::data::LogError;
use crate::model::FileError;
use crate::plant::PlantError;
use crate::train::{CheckpointError, HybridError, SegmentsError, TrainError};

/// Why a recipe cannot be carried out.
#[derive(Debug, thiserror::Error)]
pub enum RecipeError {
    #[error("{path}: cannot be read: {source}; give a recipe with --config", path = .path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {message}", path = .path.display())]
    File { path: PathBuf, message: String },
    #[error("{path}: [data]: {source}", path = .path.display())]
    Plant { path: PathBuf, source: PlantError },
    #[error("{path}: {source}", path = .path.display())]
    Segments {
        path: PathBuf,
        source: SegmentsError,
    },
    #[error("{path}: `model` is not what the checkpoint holds: {source}", path = .path.display())]
    OtherModel {
        path: PathBuf,
        source: Box<CheckpointError>,
    },
    #[error(
        "{dir} holds the checkpoint of another run: {difference}; give another folder with --out, or \
         remove this one to start anew",
        dir = .dir.display()
    )]
    OtherRun { dir: PathBuf, difference: String },
    #[error(transparent)]
    Model(#[from] FileError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Hybrid(#[from] HybridError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error(transparent)]
    Train(#[from] TrainError),
}
