use std::path::PathBuf;

use super::OptimizerKind;
use super::hybrid::HybridError;
use residyn_core::limits::EPOCHS;
use residyn_core::model::{FileError, SavedModelError};
use residyn_io::files::OutputError;

/// Why a trajectory cannot be cut into segments.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentsError {
    #[error(
        "{what} has {found} numbers, {expected} are needed for {rows} rows and {joints} joints"
    )]
    Length {
        what: &'static str,
        expected: usize,
        found: usize,
        rows: usize,
        joints: usize,
    },
    #[error("{what} of row {row} is {value}; leave such rows out before training")]
    NotFinite {
        what: &'static str,
        row: usize,
        value: f64,
    },
    #[error("time goes from {before} s to {after} s at row {row}; it must increase")]
    Time { row: usize, before: f64, after: f64 },
    #[error(
        "a trajectory of {rows} rows has no segment of {steps} steps; give longer logs or lower the number of steps"
    )]
    TooShort { rows: usize, steps: usize },
    #[error("there is nothing to train on; give at least one trajectory")]
    Empty,
}

/// Why a training run cannot start or continue.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    #[error(
        "no device `{name}`; this build has {known} (cuda: only in a build with the Cargo feature `cuda`)"
    )]
    Device { name: String, known: String },
    #[error(transparent)]
    Model(#[from] HybridError),
    #[error(transparent)]
    Segments(#[from] SegmentsError),
    #[error("{role} segments have {found} joints, but the model of `{system}` has {expected}")]
    Joints {
        role: &'static str,
        system: String,
        expected: usize,
        found: usize,
    },
    #[error(
        "{role} segments have {found} internal states, but the model of `{system}` has {expected}; cut them with \
         the states along each trajectory"
    )]
    InternalStates {
        role: &'static str,
        system: String,
        expected: usize,
        found: usize,
    },
    #[error(
        "`error_scale` needs {states} finite numbers above zero, one for each state (positions, then \
         velocities); it is {scale:?}"
    )]
    ErrorScale { states: usize, scale: Vec<f64> },
    #[error("setting `{name}` is {value}; it must be finite and not negative")]
    Setting { name: &'static str, value: f64 },
    #[error(
        "setting `weight_decay` is above 0, and {name} has no decoupled weight decay; use one of {others}",
        name = .0.name(),
        others = OptimizerKind::that_decay()
    )]
    Decay(OptimizerKind),
    #[error(
        "setting `anneal` is {0}; it must be a share of the learning rates, above 0 and at most 1"
    )]
    Anneal(f64),
    #[error("setting `epochs` is {0}; at most {EPOCHS} are trained")]
    Epochs(usize),
    #[error(
        "the loss became {loss} in epoch {epoch}, with {parameters}; look for outliers or wrong units \
         in the data, lower the learning rates, or use shorter segments or a finer integrator"
    )]
    Diverged {
        epoch: usize,
        loss: f64,
        parameters: String,
    },
}

/// Why a checkpoint cannot be written, read or used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    #[error("not a checkpoint: there is no {missing:?} in {dir:?}")]
    Missing { missing: String, dir: PathBuf },
    #[error(
        "the checkpoint has format {found}, this program reads format {expected}; use the residyn that \
         wrote it ({written_by}) or train again, in {dir:?}"
    )]
    Format {
        found: u64,
        expected: u64,
        written_by: String,
        dir: PathBuf,
    },
    #[error(
        "the checkpoint is of another model: its {what} is {saved}, the model's is {given}; use the model file saved \
         with it (model.toml), in {dir:?}"
    )]
    Foreign {
        what: &'static str,
        saved: String,
        given: String,
        dir: PathBuf,
    },
    #[error("cannot {action}: {source}, at {path:?}")]
    Io {
        action: &'static str,
        source: std::io::Error,
        path: PathBuf,
    },
    #[error("{0}")]
    Output(#[from] OutputError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Files(#[from] SavedModelError),
    #[error(transparent)]
    Model(#[from] HybridError),
    #[error(transparent)]
    Train(#[from] TrainError),
}
