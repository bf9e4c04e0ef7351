//! Model-predictive control of a plant: tasks, the controller that plans with a model, and episodes.

mod bounds;
mod controller;
mod driven;
mod episode;
mod predictor;
mod session;
mod task;

#[cfg(test)]
mod tests;

pub use bounds::Bounds;
pub use controller::{Controller, LostPlan, Policy, RandomTorque};
pub use driven::{DriveError, Driven, Held, Simulated};
pub use episode::{Episode, EpisodeError, Stretch, drive, episode};
pub use predictor::Predictor;
pub use session::with_controller;
pub use task::{Goal, NoTask, PlantSettings, Task, TaskError};
