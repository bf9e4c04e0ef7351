use thiserror::Error;

use residyn_control::control::{DriveError, EpisodeError, LostPlan};
use residyn_core::data::LogError;
use residyn_io::WriteLogError;
use residyn_io::runs::RunFolderError;
use residyn_train::{CheckpointError, HybridError, SegmentsError, TrainError};

/// Why a run of the loop cannot begin or be resumed.
#[derive(Debug, Error)]
pub enum RunError {
    #[error("{0}")]
    Drive(#[from] DriveError),
    #[error("{0}")]
    Episode(#[from] EpisodeError),
    #[error("{0}")]
    Plan(#[from] LostPlan),
    #[error(
        "the plant does not repeat its motion, so that an episode cannot be continued after a training; gather whole \
         episodes: let `gather` be the task's `steps`"
    )]
    NotRepeated,
    #[error("{0}")]
    Train(#[from] TrainError),
    #[error(transparent)]
    Hybrid(#[from] HybridError),
    #[error("{0}")]
    Segments(#[from] SegmentsError),
    #[error("{0}")]
    Log(#[from] LogError),
    #[error("{0}")]
    WriteLog(#[from] WriteLogError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("{0}")]
    Folder(#[from] RunFolderError),
}
