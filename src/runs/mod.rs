//! What a run has beside its work: a locked folder that it can be resumed from, and random numbers that depend on its
//! seed and on what they are for, and on nothing else.

mod difference;
mod folder;
mod identity;
mod lock;
mod streams;

pub use folder::{RunFolder, RunFolderError};
pub use identity::Identity;
pub use streams::{Purpose, stream};
