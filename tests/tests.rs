//! One binary for all integration tests: Burn is linked once.

mod common;
mod effects;
mod functions;
mod gradients;
mod oracles;
mod parity;
