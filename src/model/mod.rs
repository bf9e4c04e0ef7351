//! Dynamics models: the file format, the assembly of equations and effects into one program, and the
//! integrators that run it.

mod assemble;
pub mod chain;
mod dynamics;
mod effect;
mod effects_in_file;
mod file;
mod filter;
mod library;
mod network;
mod reader;
mod saved;
mod sections;
mod shift;
mod system;
mod typeset;
pub(crate) mod weights;
mod written;

pub use dynamics::{Dynamics, Parameter};
pub use effect::{EFFECT_NAMES, Effect, EffectParameter, Entry, Measure};
pub use filter::{CommandFilter, Filter};
pub use library::Library;
pub use network::{
    Angles, InputScaling, LastLayer, LayerWeights, MlpSettings, MlpWeights, NetworkError,
    ResidualOn, with_residual,
};
pub(crate) use network::{nothing_but, to_f32};
pub use reader::FileError;
pub use saved::{ModelShape, ModelWeights, Origin, SavedModelError, SavedNetwork, SavedParameter};
pub use system::{FittedEffect, Model, OwnValue};
