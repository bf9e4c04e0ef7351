//! Training: segments of trajectories, the loss through the unrolled integrator, the fit, and checkpoints from which an
//! interrupted fit resumes bit for bit.
//!
#![doc = include_str!("../../../docs/training.md")]

mod backend;
mod checkpoint;
mod composed;
mod error;
mod fit;
mod fused;
mod history;
mod hybrid;
mod loss;
mod manifest;
mod optimizer;
mod optimizer_record;
mod packed;
mod penalty;
pub mod recipe;
mod residual;
mod segments;
mod settings;
mod trained;
mod without_subnormals;

#[cfg(test)]
mod tests;

pub use backend::Backend;
pub use burn;
pub use checkpoint::{Checkpoint, save};
pub use error::{CheckpointError, SegmentsError, TrainError};
pub use fit::{Ended, Progress, Training};
pub use fused::Blocks;
use history::Best;
pub use history::Record;
use hybrid::Structure;
pub use hybrid::{
    Derivative, HybridError, HybridModel, Mlp, Physics, StepResult, Unpacked, replay,
};
pub use loss::{Batch, Objective};
pub use manifest::{FORMAT, Manifest};
pub use optimizer::{OptimizerKind, Schedule};
pub use penalty::Penalty;
pub use residual::ResidualTrainer;
pub use segments::{Columns, Segments};
pub use settings::{Batching, FitSettings, LearningRates};
pub use trained::Trained;
