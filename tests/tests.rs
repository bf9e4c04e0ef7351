//! One binary for all integration tests: Burn is linked once.

// In tests a panic is the message.
#![allow(clippy::unwrap_used)]

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
mod train;
