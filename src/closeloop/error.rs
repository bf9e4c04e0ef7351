use thiserror::Error;

use super::learn::LearnError;
use crate::identify::FitError;

/// Why the loop could not be closed at all.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    #[error(
        "the test logs hold no window of {shortest_s} s to score a model on; give longer test logs with --test, or leave out \
         less of them{found}"
    )]
    NoTest { shortest_s: f64, found: String },
    #[error(
        "{model} gives accelerations, and no torques can be compared; give its equations as `mass` and `bias`, or compare the \
         motion with --errors motion"
    )]
    NoTorques { model: String },
    #[error(
        "calibrating simulates motion, and here torques were compared: leave --calibrate out, or compare the motion with \
         --errors motion"
    )]
    NotOfMotion,
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    Learn(#[from] LearnError),
}
