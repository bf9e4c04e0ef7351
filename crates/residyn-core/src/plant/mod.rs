//! Simulated rigs: a model with hidden effects, excited and measured as a real rig is.

mod excitation;
mod file;
mod rig;
mod sampling;
mod simulate;

pub use excitation::{Excitation, Tones};
pub use file::{HiddenEffect, Plant, PlantError, Sensor};
pub use rig::{Noise, Rig};
pub use sampling::check_step;
pub use sampling::{Sampling, Starts};
