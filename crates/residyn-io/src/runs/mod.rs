//! Runs: a locked folder from which a run can be resumed, and shards of a run, which are run separately and merged.

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
