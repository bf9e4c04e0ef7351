//! One binary for all integration tests: Burn is linked once.

mod bad_input;
mod clients;
mod common;
mod demo;
mod effects;
mod functions;
mod gradients;
mod measured;
mod oracles;
mod parity;
mod support;
