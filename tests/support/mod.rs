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
pub mod reports;
pub mod run_folders;
mod scratch;
pub mod tables;
pub mod tensors;

pub use self::binary::{answers, refuses, residyn, says, succeeds, text, until_there};
#[cfg(unix)]
pub use self::binary::{residyn_within, within};
pub use self::measured::measured;
pub use self::scratch::{Scratch, copy_files, replaced, swinging, words};
