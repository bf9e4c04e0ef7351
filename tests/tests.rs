//! One binary for all integration tests: Burn is linked once.

// In tests a panic is the message.
#![allow(clippy::unwrap_used)]

mod against;
mod bad_input;
mod clients;
mod common;
mod demo;
mod effects;
mod functions;
mod gradients;
mod identify;
mod measured;
mod metric;
mod oracles;
mod parity;
mod physics;
mod printers;
mod recipes;
mod rigs;
mod support;
mod train;
