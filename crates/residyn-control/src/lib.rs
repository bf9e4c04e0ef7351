//! Planning with a model, and control by it: planners, tasks, episodes.

pub mod control;
pub mod plan;
