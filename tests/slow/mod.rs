//! Whole files of tests that `tests/run --quick` leaves out.

mod clients;
mod drivetrains;
mod experiments;
mod export_c;
mod export_fmu;
mod fuzz;
mod guide;
mod kills;
mod large_inputs;
mod measured;
mod network;
mod page;
mod plants;
mod properties;
mod recordings;
mod several_effects;
mod shards;
mod simulators;
mod slurm;
