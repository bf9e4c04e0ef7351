//! What a run has beside its work: a locked folder that it can be resumed from, and random numbers that depend on its
//! seed and on what they are for, and on nothing else; and shards of a run, which are done apart and merged. What a report
//! says of how it was made.

mod call;
mod difference;
mod folder;
mod identity;
mod lines;
mod lock;
mod merge;
mod part;
mod shard;
mod streams;

pub use call::{Call, InputFile};
pub use folder::{RunFolder, RunFolderError};
pub use identity::Identity;
pub use lines::Lines;
pub use merge::{Lacking, MergeError, merge};
pub use part::Part;
pub use shard::{Shard, ShardError};
pub use streams::{Purpose, stream};
