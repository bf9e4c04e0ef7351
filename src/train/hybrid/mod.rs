//! The hybrid model on tensors: equations with learnable parameters, networks, and the integrator's step through both.

mod equations;
mod error;
mod frame;
mod mlp;
mod model;
mod prepared;
mod replay;
mod stack;
mod step;

pub use error::HybridError;
pub(crate) use frame::Frame;
pub use model::HybridModel;
#[cfg(test)]
pub(super) use model::{PRIOR_ID, RESIDUAL_ID};
pub use prepared::{Flow, Prepared};
pub use replay::replay;
pub(super) use stack::Stack;
pub use step::Step;
