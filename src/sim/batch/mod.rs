//! Many rows side by side in f32, as wide as the processor's vectors: networks and their derivatives, and rollouts of a
//! whole model.

mod memory;
mod network;
mod network_gradient;
mod product;
mod rollout;

#[cfg(test)]
mod tests;

pub use network::Network;
pub(crate) use product::{Finish, Product};
pub use rollout::{Block, Rollouts};

use crate::lanes::Row;

/// Rows of a batch that are worked on together.
pub const W: usize = 32;

/// One value of each of them.
pub type Rows = Row<f32, W>;
