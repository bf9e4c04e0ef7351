//! The loss and its derivative in one operation: rollout, networks and penalty together, many rows at a time, on all
//! cores. The composed operations of [`composed`](super::composed) are its reference, and what other devices use.

mod blocks;
mod operation;
mod part;
mod plan;
mod record;
mod tapes;
mod work;
mod worker;

pub use blocks::Blocks;
pub(super) use operation::loss;
pub(super) use work::Workers;
