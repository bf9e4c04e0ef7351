//! Stands in for the reader of Parquet in a program built without it.

use std::path::Path;

use residyn_core::data::{Arrays, LogError};

/// # Errors
/// Always: which feature reads Parquet, and the line that converts the file.
pub(super) fn read(path: &Path) -> Result<Arrays, LogError> {
    Err(LogError::form(
        path,
        "Parquet is read only by a build with the feature `parquet`; use such a build, or convert it: \
         `python -c \"import pandas; pandas.read_parquet('run.parquet').to_csv('run.csv', index=False)\"`",
    ))
}
