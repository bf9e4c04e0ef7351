//! One binary for all integration tests: Burn is linked once.
//!
//! A test that computes for more than a few seconds, needs other programs than a shell, or kills what it starts stands in a
//! module called `slow`: in the folder of that name, or at the end of the file of its subject. `tests/run --quick` leaves
//! these out, by their paths alone, and is told of a test that needs another program by its failure.

// In tests a panic is the message.
#![allow(clippy::unwrap_used)]
// And what goes on for ever is seen.
#![allow(clippy::disallowed_methods)]

mod against;
mod arms;
mod bad_input;
mod bench;
mod bench_rigs;
mod check;
mod clients;
mod control;
mod demo;
mod drives;
mod effects;
mod elsewhere;
mod experiments;
mod export;
mod export_c;
mod export_fmu;
mod folders;
mod front_door;
mod functions;
mod fuzz;
mod golden;
mod gradients;
mod guide;
mod hard;
mod identify;
mod interrupts;
mod kills;
mod layout;
mod load;
mod log_formats;
mod logs;
mod measured;
mod mechanism;
mod memory;
mod metric;
mod models;
mod network;
mod odd;
mod oracles;
mod page;
mod parity;
mod per_log;
mod physics;
mod prescribed;
mod printers;
mod properties;
mod public_api;
mod recipes;
mod recordings;
mod rigs;
mod runs;
mod shards;
mod shell;
mod shift;
mod simulators;
mod slurm;
mod summary;
mod supply;
mod support;
mod sweep;
mod together;
mod train;
mod undeclared_effect;
mod unexplained;
mod voice;
mod write_back;
