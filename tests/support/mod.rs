//! Code that tests share, one file per subject. Tests import from here, never from each other.

pub mod arms;
pub mod bench;
mod binary;
pub mod catalogue;
pub mod clients;
pub mod committed;
pub mod demo;
pub mod exported_models;
pub mod in_folder;
pub mod interface;
pub mod log_files;
pub mod logs;
mod measured;
pub mod mechanisms;
pub mod oracles;
pub mod paths;
pub mod predictions;
pub mod run_folders;
mod scratch;
pub mod tensors;

#[cfg(unix)]
pub use self::binary::residyn_within;
pub use self::binary::{
    answers, ends_without, evaluated, refuses, residyn, says, succeeds, text, until_there,
};
pub use self::measured::measured;
pub use self::scratch::{Scratch, swinging};
