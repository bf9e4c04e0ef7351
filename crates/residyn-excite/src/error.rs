use thiserror::Error;

use residyn_core::model::ModelError;

/// Why no motion was designed.
#[derive(Debug, Error)]
pub enum ExciteError {
    /// A rig that needs logs to be simulated.
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(
        "the effect {0} has a state of its own; design the motion with a model without it, and give it as an alternative"
    )]
    State(String),
    #[error("every parameter of the model is fixed; free those that the motion is to determine")]
    NothingFree,
    #[error(
        "no motion within the limits shows a free parameter; widen the ranges of angle, speed or acceleration"
    )]
    NothingShown,
    #[error(
        "a motion of {duration_s} s in steps of {step_s} s has too few or too many rows; choose a duration of 10 to 60000 steps"
    )]
    Duration { duration_s: f64, step_s: f64 },
    #[error(
        "the rig cannot rest where the motion begins: {0}; choose another `start`, or correct the limit"
    )]
    Rest(String),
    #[error(
        "the motion of the model is not a finite number near the start; check its values, and that every joint has a drive"
    )]
    NotFinite,
    #[error(
        "the alternative {alternative} moves {found} joints, the model {expected}; add effects to the same model"
    )]
    Alternative {
        alternative: usize,
        found: usize,
        expected: usize,
    },
    #[error(
        "the joint names or columns of the log {log} do not suit the model: it has {found} joints, the model {expected}"
    )]
    Log {
        log: String,
        found: usize,
        expected: usize,
    },
    #[error(
        "the logs are too short: motions are compared in windows of half a second, a second after their start"
    )]
    ShortLogs,
}
