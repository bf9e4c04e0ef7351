//! Files of logs, as named columns of numbers: one reader a format behind one function.

mod arrays;
mod csv;
#[cfg(feature = "parquet")]
mod lerobot;
mod mat;
mod npy;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;
mod recording;
mod unpack;

use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

use flate2::read::MultiGzDecoder;

pub(super) use self::arrays::Arrays;
pub(super) use self::csv::Csv;
use self::unpack::Unpacking;
use super::columns::Columns;
use super::error::{CellFault, LogError, Place};
use crate::files;
use crate::guarded::guarded;
use crate::limits::LOG_COLUMNS;

/// Named columns of numbers.
pub(super) trait Table {
    fn names(&self) -> &[String];

    /// Where the names are.
    fn head(&self) -> Place;

    fn rows(&self) -> usize;

    /// # Errors
    /// Rows that are not whole.
    fn check(&self) -> Result<(), LogError>;

    /// # Errors
    /// A cell that is no finite number.
    fn number(&self, row: usize, column: usize) -> Result<f64, CellFault>;

    /// Where a row is.
    fn place(&self, row: usize) -> Place;

    /// What a reader of the log should know about how the file was read.
    fn notes(&self) -> &[String] {
        &[]
    }
}

/// How files of each format but text begin.
const GZIP: &[u8] = b"\x1f\x8b";
const ZIP: &[u8] = b"PK\x03\x04";
const PARQUET: &[u8] = b"PAR1";

/// Files that are known and not read: how they begin, and the line that converts them.
const FOREIGN: [(&[u8], &str); 6] = [
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
        recording::SQLITE,
        "a packed recording is not read; unpack it: `gunzip run.db3.gz`",
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
        "Parquet is not read by a program without the feature `parquet`, nor packed; build it with that, or convert it: \
         `python -c \"import pandas; pandas.read_parquet('run.parquet').to_csv('run.csv', index=False)\"`",
    ),
];

/// The table that a file or a folder holds, whatever its format: by how it begins, not by its name. Of files that hold
/// several tables, the one that has the columns.
///
/// # Errors
/// A file that cannot be read, that is of none of the formats, or that has too many columns.
pub(super) fn open(path: &Path, columns: &Columns) -> Result<Box<dyn Table>, LogError> {
    let damaged = || LogError::Form {
        path: path.to_owned(),
        fault: "is damaged: its offsets and lengths contradict each other; write it again"
            .to_owned(),
    };
    let table = guarded(|| read(path, columns)).ok_or_else(damaged)??;
    let found = table.names().len();
    if found > LOG_COLUMNS {
        return Err(LogError::Form {
            path: path.to_owned(),
            fault: format!("has {found} columns; at most {LOG_COLUMNS} are read"),
        });
    }
    Ok(table)
}

fn read(path: &Path, columns: &Columns) -> Result<Box<dyn Table>, LogError> {
    #[cfg(feature = "parquet")]
    if let Some(episode) = lerobot::Episode::of(path) {
        return Ok(Box::new(episode.read()?));
    }
    if path.is_dir() {
        return Ok(Box::new(recording::of_folder(path, columns)?));
    }
    let unreadable = |why| LogError::Open {
        path: path.to_owned(),
        why,
    };
    let mut file = files::open(path).map_err(unreadable)?;
    let begin = begin(&mut file).map_err(unreadable)?;
    // Recordings may be larger than the memory: they are not read at once.
    if begin.starts_with(recording::SQLITE) {
        return Ok(Box::new(recording::of_bag(path, columns)?));
    }
    if begin.starts_with(recording::MCAP) {
        return Ok(Box::new(recording::of_mcap(path, columns)?));
    }
    #[cfg(feature = "parquet")]
    if begin.starts_with(PARQUET) {
        return Ok(Box::new(parquet::read(path)?));
    }
    let bytes = unpacked(path, contents(file).map_err(unreadable)?)?;
    if let Some((_, remedy)) = FOREIGN.iter().find(|(begin, _)| bytes.starts_with(begin)) {
        return Err(LogError::Form {
            path: path.to_owned(),
            fault: (*remedy).to_owned(),
        });
    }
    if bytes.starts_with(ZIP) {
        return Ok(Box::new(npz::read(path, bytes)?));
    }
    if bytes.starts_with(mat::MAGIC) {
        return Ok(Box::new(mat::read(path, &bytes)?));
    }
    Ok(Box::new(Csv::of_bytes(path, &bytes)?))
}

/// The first bytes of a file.
fn begin(file: &mut File) -> io::Result<Vec<u8>> {
    let mut begin = Vec::new();
    file.take(16).read_to_end(&mut begin)?;
    file.rewind()?;
    Ok(begin)
}

fn contents(mut file: File) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes of a file, unpacked where they are packed with gzip.
fn unpacked(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>, LogError> {
    if !bytes.starts_with(GZIP) {
        return Ok(bytes);
    }
    let unpacked = Unpacking::of(bytes.len()).read(MultiGzDecoder::new(bytes.as_slice()));
    unpacked.map_err(|why| LogError::Form {
        path: path.to_owned(),
        fault: format!("cannot be unpacked: {why}"),
    })
}
