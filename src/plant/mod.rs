//! Simulated rigs: a model with effects that nobody is told about, driven and measured as a rig is.

mod excitation;
mod file;
mod rig;
mod sampling;
mod simulate;

pub use excitation::Excitation;
pub use file::{HiddenEffect, Plant, PlantError, Sensor};
pub use rig::{Noise, Rig};
pub use sampling::{Sampling, Starts};
