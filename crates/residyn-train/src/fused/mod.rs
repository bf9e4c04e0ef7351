//! The loss and its derivative in one pass each: rollout, networks and penalty together, many rows at a time, on all
//! cores. The composed operations of [`composed`](super::composed) are its reference, and are used on other devices.

mod blocks;
mod evaluation;
mod forward;
mod operation;
mod part;
mod problem;
mod programs;
mod record;
mod reverse;
mod rollout;
mod rows;
mod workspace;

pub use blocks::Blocks;
pub(super) use evaluation::Workers;
pub(super) use operation::loss;
pub(super) use problem::Problem;
