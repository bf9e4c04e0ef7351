//! Planning and control with a model: planners, tasks, episodes.

pub mod control;
pub mod plan;
