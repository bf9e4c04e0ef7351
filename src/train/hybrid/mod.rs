//! The hybrid model on tensors: equations with learnable parameters, networks, and the integrator's step through both.

mod equations;
mod error;
mod mlp;
mod model;
mod replay;
mod stack;
mod step;
mod structure;
mod tensor;
mod unpacked;

pub use error::HybridError;
pub use model::HybridModel;
pub(super) use model::Numbers;
pub use replay::replay;
pub(super) use stack::Stack;
pub use step::StepResult;
pub(crate) use structure::Structure;
pub(super) use tensor::{to_f32, to_f64, vector};
pub use unpacked::{Derivative, Unpacked};
