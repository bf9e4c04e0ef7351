//! Dynamics models: the file format, the assembly of equations and effects into one program, and the
//! integrators that run it.

mod assemble;
pub mod chain;
mod dynamics;
mod effect;
mod effects_in_file;
mod equations;
mod file;
mod filter;
mod frame;
mod hybrid;
mod integrator;
mod library;
pub(crate) mod mlp;
mod network;
mod reader;
mod sections;
mod shift;
mod stack;
mod system;
mod typeset;
mod written;

pub use dynamics::{Dynamics, Parameter};
pub use effect::{EFFECT_NAMES, Effect, EffectParameter, Entry, Measure};
pub use filter::{CommandFilter, Filter};
pub(crate) use frame::Frame;
pub use hybrid::{Flow, HybridError, HybridModel, ModelWeights, Prepared};
#[cfg(test)]
pub(crate) use hybrid::{PRIOR_ID, RESIDUAL_ID};
pub use integrator::Step;
pub use library::Library;
pub(crate) use network::nothing_but;
pub use network::{
    Angles, InputScaling, LastLayer, LayerWeights, MlpSettings, MlpWeights, ResidualOn,
    with_residual,
};
pub use reader::FileError;
pub(crate) use stack::Stack;
pub use system::{FittedEffect, Model, OwnValue};
