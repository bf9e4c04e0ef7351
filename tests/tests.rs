//! One binary for all integration tests: Burn is linked once.

mod common;
mod effects;
mod functions;
mod gradients;
mod identify;
mod metric;
mod oracles;
mod parity;
mod physics;
mod printers;
