//! Batched f32 evaluation on the processor's vectors: networks, their gradients, and rollouts of a complete model.

mod memory;
mod network;
mod network_gradient;
mod product;
mod rollout;

#[cfg(test)]
mod tests;

pub use network::Network;
pub use network_gradient::GradientSums;
pub use product::{Finish, Product};
pub use rollout::{Block, Rollouts};

use crate::lanes::Row;

/// Rows of a batch that are evaluated together, one in each lane.
pub const W: usize = 32;

/// One value per row.
pub type Rows = Row<f32, W>;
