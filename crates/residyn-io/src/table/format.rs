//! The formats of log files, recognised by how a file begins, not by its name.

use std::path::Path;

use super::csv::Csv;
use super::source::Source;
use super::{archive, hdf5, mat, npy, npz, parquet, pt, recording};
use residyn_core::data::{Arrays, Columns, LogError, Table};

/// A format of log files.
#[derive(Debug)]
pub struct LogFormat {
    pub name: &'static str,
    /// What is read and written in it, as a phrase.
    pub about: &'static str,
    /// How the names of its files end, in lower case.
    pub(crate) endings: &'static [&'static str],
    mark: Mark,
    reader: Reader,
}

/// How a format is recognised.
#[derive(Debug)]
enum Mark {
    /// By its first bytes, any of these.
    Begin(&'static [&'static [u8]]),
    /// As a zip archive that holds a file of this name.
    Archive(&'static str),
}

impl Mark {
    fn is_on(&self, begin: &[u8], source: &Source) -> bool {
        match self {
            Self::Begin(known) => known.iter().any(|known| begin.starts_with(known)),
            Self::Archive(name) => {
                let path = source.plain_file();
                let path = path.filter(|_| begin.starts_with(archive::BEGIN));
                path.is_some_and(|path| archive::size_of(path, name).is_some())
            }
        }
    }
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
        name: "pt",
        about: "logs of PyTorch, a dictionary of tensors, as PACE and legged_gym keep them, in",
        endings: &["pt", "pth"],
        mark: Mark::Archive(pt::DESCRIPTION),
        reader: Reader::File {
            read: |path, _| pt::read(path),
            packed: "a gzipped .pt is not read; unpack it: `gunzip run.pt.gz`",
        },
    },
    LogFormat {
        name: "npz",
        about: "logs of NumPy, in",
        endings: &["npz"],
        mark: Mark::Begin(&[archive::BEGIN]),
        reader: Reader::File {
            read: |path, _| npz::read(path),
            packed: "a gzipped .npz is not read; unpack it: `gunzip run.npz.gz`",
        },
    },
    LogFormat {
        name: "npy",
        about: "logs of NumPy, one matrix whose columns go by their numbers, in",
        endings: &["npy"],
        mark: Mark::Begin(&[npy::MAGIC]),
        reader: Reader::Bytes(|name, source| Ok(Box::new(npy::read(name, &source)?))),
    },
    LogFormat {
        name: "mat",
        about: "logs of MATLAB, versions 5 to 7, in",
        endings: &["mat"],
        mark: Mark::Begin(&[mat::MAGIC]),
        reader: Reader::Bytes(|name, source| Ok(Box::new(mat::read(name, &source)?))),
    },
    LogFormat {
        name: "hdf5",
        about: "logs of h5py, recorders of demonstrations and MATLAB's version 7.3, in",
        endings: &["h5", "hdf5"],
        mark: Mark::Begin(&hdf5::BEGIN),
        reader: Reader::File {
            read: |path, _| hdf5::read(path),
            packed: "a gzipped HDF5 file is not read; unpack it: `gunzip run.h5.gz`",
        },
    },
    LogFormat {
        name: "mcap",
        about: "recordings of robots, joint states in CDR or JSON, in",
        endings: &["mcap"],
        mark: Mark::Begin(&[b"\x89MCAP0\r\n"]),
        reader: Reader::File {
            read: recording::of_mcap,
            packed: "a packed recording is not read; unpack it: `gunzip run.mcap.gz`",
        },
    },
    LogFormat {
        name: "rosbag2",
        about: "recordings of ROS 2 as .db3 files and folders, in",
        endings: &["db3"],
        mark: Mark::Begin(&[b"SQLite format 3\0"]),
        reader: Reader::File {
            read: recording::of_bag,
            packed: "a packed recording is not read; unpack it: `gunzip run.db3.gz`",
        },
    },
    LogFormat {
        name: "parquet",
        about: "logs, and data sets of LeRobot, in",
        endings: &["parquet"],
        mark: Mark::Begin(&[b"PAR1"]),
        reader: Reader::File {
            read: |path, _| parquet::read(path),
            packed: "a gzipped Parquet file is not read; unpack it: `gunzip run.parquet.gz`",
        },
    },
    LogFormat {
        name: "csv",
        about: "logs, out; in with any separator, decimal commas, and packed with gzip",
        endings: &["csv", "tsv", "csv.gz", "tsv.gz"],
        mark: Mark::Begin(&[b""]),
        reader: Reader::Bytes(|name, source| Ok(Box::new(Csv::of(name, source)?))),
    },
];

/// Formats that are recognised but not read: their first bytes, and the line that converts them.
const FOREIGN: [(&[u8], &str); 2] = [
    (
        b"#ROSBAG",
        "a ROS 1 bag is not read; convert it: `pip install rosbags && rosbags-convert --src run.bag --dst run`, and read the \
         folder `run`",
    ),
    (
        b"\x28\xb5\x2f\xfd",
        "is packed with zstd; unpack it: `zstd -d run.db3.zstd`",
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
    let format = formats.find(|format| format.mark.is_on(&begin, &source));
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
