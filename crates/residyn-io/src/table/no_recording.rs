//! Stands in for the readers of recordings in a program built without them.

use std::path::Path;

use residyn_core::data::{Arrays, Columns, LogError};

pub(super) use self::{of_folder as of_bag, of_folder as of_mcap};

/// # Errors
/// Always: which feature reads recordings.
pub(super) fn of_folder(path: &Path, _: &Columns) -> Result<Arrays, LogError> {
    Err(LogError::form(
        path,
        "ROS folders and recordings are read only by a build with the feature `recordings`; use such a build, or write \
         the log as CSV",
    ))
}
