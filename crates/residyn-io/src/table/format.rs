//! The formats of log files, recognised by how a file begins, not by its name.

use std::path::Path;

use super::csv::Csv;
use super::source::Source;
use super::{mat, npy, npz, parquet, recording};
use residyn_core::data::{Arrays, Columns, LogError, Table};

/// A format of log files.
#[derive(Debug)]
pub struct LogFormat {
    pub name: &'static str,
    /// What is read and written in it, as a phrase.
    pub about: &'static str,
    /// Its first bytes.
    begin: &'static [u8],
    reader: Reader,
}

#[derive(Debug)]
enum Reader {
    /// Of a file that is not packed: it may be larger than the memory, or is not read from its beginning. `packed` is
    /// what to do about a packed one.
    File {
        read: fn(&Path, &Columns) -> Result<Arrays, LogError>,
        packed: &'static str,
    },
    /// Of bytes from their beginning, packed or not.
    Bytes(OfBytes),
}

type OfBytes = fn(&Path, Source) -> Result<Box<dyn Table>, LogError>;

/// Every format. A new one is one more entry here, before that of texts, which may begin with anything.
pub const LOG_FORMATS: &[LogFormat] = &[
    LogFormat {
        name: "npz",
        about: "logs of NumPy, in",
        begin: b"PK\x03\x04",
        reader: Reader::File {
            read: |path, _| npz::read(path),
            packed: "a gzipped .npz is not read; unpack it: `gunzip run.npz.gz`",
        },
    },
    LogFormat {
        name: "npy",
        about: "logs of NumPy, one matrix whose columns go by their numbers, in",
        begin: npy::MAGIC,
        reader: Reader::Bytes(|name, source| Ok(Box::new(npy::read(name, &source)?))),
    },
    LogFormat {
        name: "mat",
        about: "logs of MATLAB, versions 5 to 7, in",
        begin: mat::MAGIC,
        reader: Reader::Bytes(|name, source| Ok(Box::new(mat::read(name, &source)?))),
    },
    LogFormat {
        name: "mcap",
        about: "recordings of robots, joint states in CDR or JSON, in",
        begin: b"\x89MCAP0\r\n",
        reader: Reader::File {
            read: recording::of_mcap,
            packed: "a packed recording is not read; unpack it: `gunzip run.mcap.gz`",
        },
    },
    LogFormat {
        name: "rosbag2",
        about: "recordings of ROS 2 as .db3 files and folders, in",
        begin: b"SQLite format 3\0",
        reader: Reader::File {
            read: recording::of_bag,
            packed: "a packed recording is not read; unpack it: `gunzip run.db3.gz`",
        },
    },
    LogFormat {
        name: "parquet",
        about: "logs, and data sets of LeRobot, in",
        begin: b"PAR1",
        reader: Reader::File {
            read: |path, _| parquet::read(path),
            packed: "a gzipped Parquet file is not read; unpack it: `gunzip run.parquet.gz`",
        },
    },
    LogFormat {
        name: "csv",
        about: "logs, out; in with any separator, decimal commas, and packed with gzip",
        begin: b"",
        reader: Reader::Bytes(|name, source| Ok(Box::new(Csv::of(name, source)?))),
    },
];

/// Formats that are recognised but not read: their first bytes, and the line that converts them.
const FOREIGN: [(&[u8], &str); 4] = [
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
        b"\x89HDF",
        "HDF5 is not read; convert it: `python -c \"import h5py, numpy; f = h5py.File('run.h5'); numpy.savez('run.npz', **{k: f[k][:] for k in f})\"`",
    ),
    (
        b"MATLAB 7.3",
        "MATLAB's version 7.3 is HDF5, which is not read; save it with '-v7', or convert it: \
         `python -c \"import h5py, numpy; f = h5py.File('run.mat'); numpy.savez('run.npz', **{k: f[k][:].T for k in f if k[0] != '#'})\"`",
    ),
];

/// The table in these bytes, read by the format that begins like them; `name` is for messages.
///
/// # Errors
/// A format that is not read, or not from there, and those of its reader.
pub(super) fn read(
    name: &Path,
    source: Source,
    columns: &Columns,
) -> Result<Box<dyn Table>, LogError> {
    let begin = source.begin(name)?;
    if let Some((_, remedy)) = FOREIGN.iter().find(|(known, _)| begin.starts_with(known)) {
        return Err(LogError::form(name, *remedy));
    }
    let mut formats = LOG_FORMATS.iter();
    let format = formats.find(|format| begin.starts_with(format.begin));
    match format.expect("a text begins with anything").reader {
        Reader::Bytes(read) => read(name, source),
        Reader::File { read, packed } => match source.plain_file() {
            Some(path) => Ok(Box::new(read(path, columns)?)),
            None if source.is_packed() => Err(LogError::form(name, packed)),
            None => Err(LogError::form(
                name,
                "its format is read from files only; write it to a file",
            )),
        },
    }
}
