//! What a run has beside its work: a locked folder that it can be resumed from, and random numbers that depend on its
//! seed and on what they are for, and on nothing else. What a report says of how it was made.

mod call;
mod difference;
mod folder;
mod identity;
mod lock;
mod streams;

pub use call::{Call, InputFile};
pub use folder::{RunFolder, RunFolderError};
pub use identity::Identity;
pub use streams::{Purpose, stream};
