//! Training: segments of trajectories, the loss through the unrolled integrator, the one fit loop, and
//! checkpoints from which it goes on bit for bit.

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
mod sweep;

#[cfg(test)]
mod tests;

pub use backend::Backend;
pub use checkpoint::{Checkpoint, save};
pub use error::{CheckpointError, TrainError};
pub use fit::{Ended, Progress, Training};
pub use fused::Blocks;
pub use history::{Best, Record};
pub use hybrid::{Flow, HybridError, HybridModel, Prepared, Step, replay};
use hybrid::{Frame, Stack};
pub use import::save_imported;
pub use loss::{Loss, Objective};
pub use manifest::{FORMAT, Manifest};
pub use penalty::Penalty;
pub use residual::ResidualTrainer;
pub use segments::{Batch, Columns, Segments, SegmentsError};
pub use settings::{Batching, FitSettings, LearningRates};
pub use sweep::{Start, Sweep, SweepProgress, Trained};
