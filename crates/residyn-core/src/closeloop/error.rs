use thiserror::Error;

use crate::data::LogError;
use crate::identify::FitError;
use crate::limits::FITTED_PARAMETERS;

/// Why the loop could not be closed at all.
#[derive(Debug, Error)]
pub enum StudyError {
    #[error(
        "the test logs contain no window of {shortest_s} s to score a model on; give longer test logs, or leave out \
         less of them{found}"
    )]
    NoTest { shortest_s: f64, found: String },
    #[error(
        "{model} gives accelerations, so torques cannot be compared; give its equations as `mass` and `bias`, or \
         compare the motion"
    )]
    NoTorques { model: String },
    #[error(
        "the calibration simulates motion, but torques were compared; do not calibrate, or compare the motion"
    )]
    NotOfMotion,
    #[error(
        "{model} has {free} free parameters, but at most {FITTED_PARAMETERS} can be fitted at once; mark the known \
         ones `fixed = true`"
    )]
    TooManyParameters { model: String, free: usize },
    /// A log lacks a measured column that the model reads.
    #[error("{0}")]
    Log(#[from] LogError),
    #[error("{0}")]
    Fit(#[from] FitError),
}
