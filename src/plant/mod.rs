//! Simulated rigs: a model with effects that nobody is told about, driven and measured as a rig is.

mod excitation;
mod file;
mod simulate;

pub use excitation::Excitation;
pub use file::{Plant, PlantError, Sensor};
