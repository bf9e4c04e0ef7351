//! Model-based reinforcement learning: train a model on the recorded motion of a plant, control the plant with it, add
//! the new motion to the data, and repeat.

mod error;
mod experience;
mod folder;
mod judge;
mod learner;
mod run;

#[cfg(test)]
mod tests;

pub use error::RunError;
pub use experience::Experience;
pub use folder::Folder;
pub use judge::{Judge, Judged};
pub use learner::{Learner, Prior};
pub use run::{Progress, Round, Run, Schedule};
