//! Training: segments of trajectories, the loss through the unrolled integrator, the fit, and checkpoints from which an
//! interrupted fit resumes bit for bit.

mod backend;
mod checkpoint;
mod composed;
mod error;
mod fit;
mod fused;
mod history;
mod hybrid;
mod import;
mod loss;
mod manifest;
mod moments;
mod optimizer;
mod penalty;
pub mod recipe;
mod residual;
mod segments;
mod settings;
mod stacked;
mod sweep;
mod variant;

#[cfg(test)]
mod tests;

pub use backend::Backend;
pub use checkpoint::{Checkpoint, save};
pub use error::{CheckpointError, SegmentsError, TrainError};
pub use fit::{Ended, Progress, Training};
pub use fused::Blocks;
use history::Best;
pub use history::Record;
pub use hybrid::{Derivative, HybridError, HybridModel, StepResult, Unpacked, replay};
use hybrid::{Stack, Structure};
pub use import::save_imported;
pub use loss::{Batch, Objective};
pub use manifest::{FORMAT, Manifest};
pub use penalty::Penalty;
pub use residual::ResidualTrainer;
pub use segments::{Columns, Segments};
pub use settings::{Batching, FitSettings, LearningRates};
pub use sweep::Sweep;
pub use variant::{SweepProgress, Trained, Variant};
