//! Log files as named columns of numbers: one reader per format, behind one function.

mod archive;
mod arrays;
mod budget;
mod channels;
mod csv;
#[cfg(feature = "parquet")]
mod ending;
#[cfg(feature = "parquet")]
mod footer;
mod format;
mod hdf5;
#[cfg(feature = "parquet")]
mod lerobot;
mod mat;
mod npy;
mod npz;
#[cfg_attr(not(feature = "parquet"), path = "no_parquet.rs")]
mod parquet;
mod pt;
#[cfg_attr(not(feature = "recordings"), path = "no_recording.rs")]
mod recording;
mod source;

use std::io::Read;
use std::path::Path;

use self::source::Source;
use residyn_core::data::{Columns, LogError, Table};

use crate::guarded::guarded;
use residyn_core::limits::LOG_COLUMNS;

pub use format::{LOG_FORMATS, LogFormat};

/// Whether a folder is a data set of LeRobot.
pub(super) fn is_data_set(folder: &Path) -> bool {
    folder.join(DATA_SET).is_file()
}

/// The file that identifies a data set of LeRobot and describes it.
const DATA_SET: &str = "meta/info.json";

/// The table that a file or a folder holds, whatever its format: by how it begins, not by its name. If a file holds
/// several tables, the one that has the columns.
///
/// # Errors
/// A file that cannot be read, that is of none of the formats, or that has too many columns.
pub(super) fn open(path: &Path, columns: &Columns) -> Result<Box<dyn Table>, LogError> {
    checked(path, || in_file(path, columns))
}

/// The table that a reader has: a text or a MATLAB file, packed with gzip or not. `name` is for messages.
///
/// # Errors
/// A reader that fails, a format that is read from files only, or one of those of [`open`].
pub(super) fn open_reader(
    name: &Path,
    reader: impl Read,
    columns: &Columns,
) -> Result<Box<dyn Table>, LogError> {
    let source = Source::held(name, reader)?;
    checked(name, || format::read(name, source, columns))
}

/// A table with columns that are not too many, from a format's reader, which may panic on a damaged file.
fn checked(
    path: &Path,
    read: impl FnOnce() -> Result<Box<dyn Table>, LogError>,
) -> Result<Box<dyn Table>, LogError> {
    let damaged = "is damaged: its offsets and lengths contradict each other; write it again";
    let table = guarded(read).ok_or_else(|| LogError::form(path, damaged))??;
    let found = table.names().len();
    if found > LOG_COLUMNS {
        let fault = format!("has {found} columns; at most {LOG_COLUMNS} are read");
        return Err(LogError::form(path, fault));
    }
    Ok(table)
}

fn in_file(path: &Path, columns: &Columns) -> Result<Box<dyn Table>, LogError> {
    #[cfg(feature = "parquet")]
    if let Some(episode) = lerobot::Episode::of(path) {
        return Ok(Box::new(episode.read()?));
    }
    if let Some(part) = hdf5::Part::of(path) {
        return Ok(Box::new(part.read()?));
    }
    if path.is_dir() {
        return Ok(Box::new(recording::of_folder(path, columns)?));
    }
    format::read(path, Source::of(path)?, columns)
}
