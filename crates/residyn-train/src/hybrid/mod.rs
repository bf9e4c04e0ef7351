//! The hybrid model on tensors: equations with learnable parameters, networks, and the integrator's step through both.

mod error;
mod flat;
mod mlp;
mod model;
mod physics;
mod replay;
mod step;
mod structure;
mod tensor;
mod unpacked;

pub use error::HybridError;
pub(super) use flat::{join, numbers_of, primitive};
pub use mlp::Mlp;
pub use model::HybridModel;
pub use physics::Physics;
pub(super) use physics::within_bounds;
pub use replay::replay;
pub use step::StepResult;
pub(crate) use structure::Structure;
#[cfg(test)]
pub(super) use tensor::to_f32;
pub(super) use tensor::{to_f64, vector};
pub use unpacked::{Derivative, Unpacked};
