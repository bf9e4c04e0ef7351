//! Model-based reinforcement learning: train a model on the recorded motion of a plant, control the plant with it, add
//! the new motion to the data, and repeat.

mod error;
mod evaluator;
mod folder;
mod learner;
mod run;
mod transitions;

#[cfg(test)]
mod tests;

pub use error::RunError;
pub use evaluator::{EpisodeScore, Evaluator};
pub use folder::Folder;
pub use learner::{Learner, Prior};
pub use run::{Round, Run, RunState, Schedule};
pub use transitions::transitions;
