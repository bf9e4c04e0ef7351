//! What a run has beside its work: a locked folder that it can be resumed from, and shards of
//! a run, which are done apart and merged.

mod difference;
mod folder;
mod identity;
mod lines;
mod lock;
mod merge;
mod part;
mod shard;

pub use folder::{RunFolder, RunFolderError};
pub use identity::Identity;
pub use lines::Lines;
pub use merge::{Lacking, MergeError, merge};
pub use part::Part;
pub use shard::{Shard, ShardError};
