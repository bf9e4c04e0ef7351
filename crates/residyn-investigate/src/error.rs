use residyn_control::control::DriveError;
use residyn_core::closeloop::StudyError;
use residyn_core::data::LogError;
use residyn_excite::ExciteError;
use residyn_io::WriteLogError;
use residyn_io::runs::RunFolderError;
use thiserror::Error;

use super::runaway::Runaway;

/// Why an investigation cannot go on.
#[derive(Debug, Error)]
pub enum InvestigateError {
    #[error("{0}")]
    Excite(#[from] ExciteError),
    #[error("{0}")]
    Drive(#[from] DriveError),
    #[error("run {run}: {source}")]
    Study { run: usize, source: StudyError },
    #[error("{0}")]
    Log(#[from] LogError),
    #[error("{0}")]
    Folder(#[from] RunFolderError),
    #[error("{0}")]
    Kept(#[from] WriteLogError),
    #[error(
        "the model {model} has {found} joints, but the plant {plant} has {joints}; investigate with a model of the plant"
    )]
    Joints {
        model: String,
        found: usize,
        plant: String,
        joints: usize,
    },
    #[error("the model {model} is driven by {found}, but the plant {plant} takes {taken}")]
    Driven {
        model: String,
        found: &'static str,
        plant: String,
        taken: &'static str,
    },
    #[error(
        "joint {joint} does not follow its motor in the model; a motion of every joint can be designed only where each has a motor"
    )]
    NoMotor { joint: usize },
    #[error(
        "run {run}: joint {} moved at {:.1} where the limits allow {}, and the plant was told its safe command; the model is too far from the rig to be \
         followed: close the loop on a log of a small motion first, or begin with lower limits",
        runaway.joint, runaway.speed, runaway.limit
    )]
    RanAway { run: usize, runaway: Runaway },
    #[error(
        "{motion_s} s of motion are less than a run of {run_s} s; allow more motion, or shorter runs"
    )]
    TooShort { motion_s: f64, run_s: f64 },
}
