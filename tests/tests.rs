//! One binary for all integration tests: Burn is linked once.

mod train;
