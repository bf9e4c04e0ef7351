//! Dynamics models: the file format, the assembly of equations and effects into one program, and the
//! integrators that run it.

mod assemble;
mod dynamics;
mod effect;
mod effects_in_file;
mod library;
mod reader;
mod rollout;
mod system;

pub use dynamics::{Dynamics, Parameter};
pub use effect::{EFFECT_NAMES, Effect, EffectParameter, Entry, Measure};
pub use library::Library;
pub use reader::FileError;
pub use rollout::Rollout;
pub use system::{FittedEffect, System};
