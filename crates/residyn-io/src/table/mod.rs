//! Log files as named columns of numbers: one reader per format, behind one function.

mod arrays;
mod budget;
mod csv;
#[cfg(feature = "parquet")]
mod ending;
#[cfg(feature = "parquet")]
mod lerobot;
mod mat;
mod npy;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg_attr(not(feature = "recordings"), path = "no_recording.rs")]
mod recording;
mod source;

use std::io::Read;
use std::path::Path;

use self::csv::Csv;
use self::source::Source;
use residyn_core::data::{Columns, LogError, Table};

use crate::guarded::guarded;
use residyn_core::limits::LOG_COLUMNS;

/// The first bytes of each format except text.
const ZIP: &[u8] = b"PK\x03\x04";
const PARQUET: &[u8] = b"PAR1";
const SQLITE: &[u8] = b"SQLite format 3\0";
const MCAP: &[u8] = b"\x89MCAP0\r\n";

/// The formats that are read here and there, from files only.
const FROM_FILES: [&[u8]; 4] = [ZIP, PARQUET, SQLITE, MCAP];

/// Formats that are recognised but not read: their first bytes, and the line that converts them.
const FOREIGN: [(&[u8], &str); 7] = [
    (
        b"#ROSBAG",
        "a ROS 1 bag is not read; convert it: `pip install rosbags && rosbags-convert --src run.bag --dst run`, and read the \
         folder `run`",
    ),
    (
        b"\x28\xb5\x2f\xfd",
        "is packed with zstd; unpack it: `zstd -d run.db3.zstd`",
    ),
    (
        SQLITE,
        "a packed recording is not read; unpack it: `gunzip run.db3.gz`",
    ),
    (
        ZIP,
        "a gzipped .npz is not read; unpack it: `gunzip run.npz.gz`",
    ),
    (
        b"\x89HDF",
        "HDF5 is not read; convert it: `python -c \"import h5py, numpy; f = h5py.File('run.h5'); numpy.savez('run.npz', **{k: f[k][:] for k in f})\"`",
    ),
    (
        b"MATLAB 7.3",
        "MATLAB's version 7.3 is HDF5, which is not read; save it with '-v7', or convert it: \
         `python -c \"import h5py, numpy; f = h5py.File('run.mat'); numpy.savez('run.npz', **{k: f[k][:].T for k in f if k[0] != '#'})\"`",
    ),
    (
        PARQUET,
        "Parquet is read only unpacked, by a build with the feature `parquet`; use such a build, or convert it: \
         `python -c \"import pandas; pandas.read_parquet('run.parquet').to_csv('run.csv', index=False)\"`",
    ),
];

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
    checked(name, || in_source(name, source, columns))
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
    if path.is_dir() {
        return Ok(Box::new(recording::of_folder(path, columns)?));
    }
    in_source(path, Source::of(path)?, columns)
}

fn in_source(name: &Path, source: Source, columns: &Columns) -> Result<Box<dyn Table>, LogError> {
    let begin = source.begin(name)?;
    // Recordings may be larger than the memory: they are not read at once.
    if let Some(path) = source.plain_file() {
        if begin.starts_with(SQLITE) {
            return Ok(Box::new(recording::of_bag(path, columns)?));
        }
        if begin.starts_with(MCAP) {
            return Ok(Box::new(recording::of_mcap(path, columns)?));
        }
        if begin.starts_with(ZIP) {
            return Ok(Box::new(npz::read(path)?));
        }
        #[cfg(feature = "parquet")]
        if begin.starts_with(PARQUET) {
            return Ok(Box::new(parquet::read(path)?));
        }
    } else if !source.is_packed() && FROM_FILES.iter().any(|known| begin.starts_with(known)) {
        return Err(LogError::form(
            name,
            "its format is read from files only; write it to a file",
        ));
    }
    if let Some((_, remedy)) = FOREIGN.iter().find(|(known, _)| begin.starts_with(known)) {
        return Err(LogError::form(name, *remedy));
    }
    if begin.starts_with(mat::MAGIC) {
        return Ok(Box::new(mat::read(name, &source)?));
    }
    Ok(Box::new(Csv::of(name, source)?))
}
