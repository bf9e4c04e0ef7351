//! In place of the readers of recordings, in a program without them.

use std::path::Path;

use residyn_core::data::{Arrays, Columns, LogError};

pub(super) use self::{of_folder as of_bag, of_folder as of_mcap};

/// # Errors
/// Always: which feature reads recordings.
pub(super) fn of_folder(path: &Path, _: &Columns) -> Result<Arrays, LogError> {
    Err(LogError::Form {
        path: path.to_owned(),
        fault: "folders and recordings of ROS are not read by a program without the feature `recordings`; build it with that, \
                or write the log as CSV"
            .to_owned(),
    })
}
