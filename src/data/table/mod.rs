//! Files of logs, as named columns of numbers: one reader a format behind one function.

mod arrays;
mod csv;
mod npy;
mod npz;

use std::fs;
use std::io::Read;
use std::path::Path;

use flate2::read::MultiGzDecoder;

pub(super) use self::arrays::Arrays;
pub(super) use self::csv::Csv;
use super::error::{CellFault, LogError, Place};

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
}

/// How files of each format but text begin.
const GZIP: &[u8] = b"\x1f\x8b";
const ZIP: &[u8] = b"PK\x03\x04";

/// Files that are known and not read: how they begin, and the line that converts them.
const FOREIGN: [(&[u8], &str); 4] = [
    (
        b"#ROSBAG",
        "a ROS 1 bag is not read; convert it: `pip install rosbags && rosbags-convert --src run.bag --dst run`, then export its \
         joint states as CSV",
    ),
    (
        b"\x89HDF",
        "HDF5 is not read; convert it: `python -c \"import h5py, numpy; f = h5py.File('run.h5'); numpy.savez('run.npz', **{k: f[k][:] for k in f})\"`",
    ),
    (
        b"MATLAB",
        "MATLAB files are not read; convert it: `python -c \"import scipy.io, numpy; numpy.savez('run.npz', **{k: v for k, v in scipy.io.loadmat('run.mat').items() if k[0] != '_'})\"`",
    ),
    (
        b"PAR1",
        "Parquet is not read; convert it: `python -c \"import pandas; pandas.read_parquet('run.parquet').to_csv('run.csv', index=False)\"`",
    ),
];

/// The table that a file holds, whatever its format: by how it begins, not by its name.
///
/// # Errors
/// A file that cannot be read, or that is of none of the formats.
pub(super) fn open(path: &Path) -> Result<Box<dyn Table>, LogError> {
    let unreadable = |why| LogError::Open {
        path: path.to_owned(),
        why,
    };
    let mut bytes = fs::read(path).map_err(unreadable)?;
    if bytes.starts_with(GZIP) {
        let mut unpacked = Vec::new();
        MultiGzDecoder::new(bytes.as_slice())
            .read_to_end(&mut unpacked)
            .map_err(unreadable)?;
        bytes = unpacked;
    }
    if let Some((_, remedy)) = FOREIGN.iter().find(|(begin, _)| bytes.starts_with(begin)) {
        return Err(LogError::Form {
            path: path.to_owned(),
            fault: (*remedy).to_owned(),
        });
    }
    if bytes.starts_with(ZIP) {
        return Ok(Box::new(npz::read(path, bytes)?));
    }
    Ok(Box::new(Csv::of_bytes(path, &bytes)?))
}
