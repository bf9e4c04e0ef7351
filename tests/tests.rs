//! One binary for all integration tests: Burn is linked once.

mod recipes;
mod train;
