//! Training: segments of trajectories, the loss through the unrolled integrator, the one fit loop, and
//! checkpoints from which it goes on bit for bit.

mod backend;
mod checkpoint;
mod composed;
mod error;
mod fit;
mod fused;
mod history;
mod loss;
mod manifest;
mod moments;
mod optimizer;
mod penalty;
pub mod recipe;
mod segments;
mod settings;
mod sweep;
pub(crate) mod weights;

#[cfg(test)]
mod tests;

pub use backend::Backend;
pub use checkpoint::{Checkpoint, Origin, save};
pub use error::{CheckpointError, TrainError};
pub use fit::{Ended, Progress, Training};
pub use fused::Blocks;
pub use history::{Best, Record};
pub use loss::{Loss, Objective};
pub use manifest::{FORMAT, Manifest, Shape};
pub use penalty::Penalty;
pub use segments::{Batch, Columns, Segments, SegmentsError};
pub use settings::{Batching, FitSettings, LearningRates};
pub use sweep::{Start, Sweep, SweepProgress, Trained};
