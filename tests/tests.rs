//! One binary for all integration tests: Burn is linked once.
//!
//! A test that computes for more than a few seconds, needs programs other than a shell, or kills processes that it
//! starts belongs in a module called `slow`: in the folder of that name, or at the end of its subject's file.
//! `tests/run --quick` skips these modules by their paths; a test elsewhere that needs another program fails there.

// In tests a panic is the message.
#![allow(clippy::unwrap_used)]
// A method that never ends is noticed.
#![allow(clippy::disallowed_methods)]

mod actuator_blocks;
mod arms;
mod bad_input;
mod bad_values;
mod bench;
mod bench_rigs;
mod check;
mod configurations;
mod control;
mod demo;
mod dependencies;
mod drives;
mod edge_cases;
mod effects;
mod excite;
mod export;
mod flags;
mod folders;
mod front_door;
mod functions;
mod golden;
mod gradients;
mod identify;
mod internal_states;
mod interrupts;
mod layout;
mod like_joints;
mod log_formats;
mod logs;
mod many_joints;
mod measured_columns;
mod mechanism;
mod memory;
mod metric;
mod models;
mod monitor;
mod oracles;
mod parameter_shift;
mod parity;
mod per_log;
mod physics;
mod position_controlled;
mod printers;
mod public_api;
mod published_parameters;
mod recipes;
mod reference_models;
mod relative_paths;
mod repeated_readings;
mod robot_and_logs;
mod runs;
mod shell;
mod slow;
mod support;
mod sweep;
mod terminal_summary;
mod torque_columns;
mod train;
mod undeclared_effect;
mod unexplained;
mod verbosity;
mod walls;
mod write_back;
