use thiserror::Error;

use crate::control::{EpisodeError, LostPlan};
use crate::data::LogError;
use crate::plant::PlantError;
use crate::runs::RunFolderError;
use crate::train::{CheckpointError, TrainError};

/// Why a run of the loop cannot begin or be resumed.
#[derive(Debug, Error)]
pub enum RunError {
    #[error("{0}")]
    Plant(#[from] PlantError),
    #[error("{0}")]
    Episode(#[from] EpisodeError),
    #[error("{0}")]
    Plan(#[from] LostPlan),
    #[error("{0}")]
    Train(#[source] TrainError),
    #[error("{0}")]
    Log(#[from] LogError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("{0}")]
    Folder(#[from] RunFolderError),
}

/// From whatever a [`TrainError`] can be made of.
impl<E: Into<TrainError>> From<E> for RunError {
    fn from(error: E) -> Self {
        Self::Train(error.into())
    }
}
