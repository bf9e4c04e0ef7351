use std::io;
use std::time::Duration;

use residyn_control::control::DriveError;
use thiserror::Error;

/// Why a plant in another process cannot be driven, or no longer.
#[derive(Debug, Error)]
pub enum RemoteError {
    #[error("the plant `{plant}` cannot be reached: {source}; {remedy}")]
    Unreachable {
        plant: String,
        source: io::Error,
        remedy: &'static str,
    },
    #[error("the plant ended without a word{0}; what it printed is above")]
    Ended(String),
    #[error(
        "the plant has said nothing for {} s; is it running, and does it flush its output?",
        .0.as_secs_f64()
    )]
    Silent(Duration),
    #[error("line {line} of the plant is not a message: {fault}; docs/plants.md has the protocol")]
    Malformed { line: usize, fault: String },
    #[error("line {line} of the plant: {fault}")]
    Refused { line: usize, fault: String },
    #[error("the plant reports an error and has stopped: {0}")]
    OfPlant(String),
    #[error("the command {value} of joint {joint} is not a number; the plant was stopped")]
    Command { joint: usize, value: f64 },
    #[error("the rows cannot be kept: {0}")]
    NotKept(#[from] io::Error),
}

impl From<RemoteError> for DriveError {
    fn from(error: RemoteError) -> Self {
        Self::Elsewhere(Box::new(error))
    }
}
