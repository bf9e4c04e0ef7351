//! One binary for all integration tests: Burn is linked once.

mod bad_input;
mod clients;
mod demo;
mod measured;
mod support;
