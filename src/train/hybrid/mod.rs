//! The hybrid model on tensors: equations with learnable parameters, networks, and the integrator's step through both.

mod equations;
mod error;
mod mlp;
mod model;
mod prepared;
mod replay;
mod stack;
mod step;
mod structure;
mod tensor;

pub use error::HybridError;
pub use model::HybridModel;
#[cfg(test)]
pub(super) use model::{PRIOR_ID, RESIDUAL_ID};
pub use prepared::{Derivative, Prepared};
pub use replay::replay;
pub(super) use stack::Stack;
pub use step::StepResult;
pub(crate) use structure::Structure;
pub(super) use tensor::{to_f64, vector};
