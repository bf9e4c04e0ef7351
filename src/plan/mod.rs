//! Planning: the cross-entropy method over sequences of inputs. It knows an objective and what may be commanded,
//! and asks somebody else what a sequence brings.

mod cross_entropy;
mod gaussian;
mod model;
mod objective;

#[cfg(test)]
mod tests;

pub use cross_entropy::{CrossEntropy, Evaluate, Plan, Settings};
pub use model::Start;
pub use objective::Objective;
