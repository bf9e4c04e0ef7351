//! A file that is read from its beginning as often as it is needed, and never at once.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use super::unpack::Unpacked;
use crate::data::error::LogError;
use crate::files;

/// How files begin that are packed with gzip.
const GZIP: &[u8] = b"\x1f\x8b";

/// Bytes that are taken from a file at once.
pub(super) const BLOCK: usize = 1 << 16;

/// A file, unpacked where it is packed with gzip.
pub struct Source {
    path: PathBuf,
    is_packed: bool,
}

impl Source {
    /// # Errors
    /// A file that cannot be read.
    pub fn of(path: &Path) -> Result<Self, LogError> {
        let mut source = Self {
            path: path.to_owned(),
            is_packed: false,
        };
        source.is_packed = source.begin()?.starts_with(GZIP);
        Ok(source)
    }

    /// Whether the file is packed.
    pub fn is_packed(&self) -> bool {
        self.is_packed
    }

    /// All that it holds, from the beginning.
    ///
    /// # Errors
    /// A file that cannot be opened.
    pub fn open(&self) -> io::Result<Box<dyn Read>> {
        let file = files::open(&self.path)?;
        match self.is_packed {
            true => Ok(Box::new(unpacked(file)?)),
            false => Ok(Box::new(file)),
        }
    }

    /// Its first bytes.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn begin(&self) -> Result<Vec<u8>, LogError> {
        self.read(16)
    }

    /// All bytes of a file that is to be read at once.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn contents(&self) -> Result<Vec<u8>, LogError> {
        self.read(u64::MAX)
    }

    /// A file in which parts are sought: as it is or, if it is packed, in memory.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn archive(&self) -> Result<Box<dyn Archive>, LogError> {
        if self.is_packed {
            return Ok(Box::new(Cursor::new(self.contents()?)));
        }
        let file = files::open(&self.path);
        let file = file.map_err(|why| self.fault(&self.path, why))?;
        Ok(Box::new(BufReader::with_capacity(BLOCK, file)))
    }

    fn read(&self, most: u64) -> Result<Vec<u8>, LogError> {
        let mut bytes = Vec::new();
        let read = |source: Box<dyn Read>| source.take(most).read_to_end(&mut bytes);
        let read = self.open().and_then(read);
        read.map_err(|why| self.fault(&self.path, why))?;
        Ok(bytes)
    }

    /// Why it cannot be read, by the name that its user gave it.
    pub fn fault(&self, path: &Path, why: io::Error) -> LogError {
        let path = path.to_owned();
        match self.is_packed {
            true => LogError::Form {
                path,
                fault: format!("cannot be unpacked: {why}"),
            },
            false => LogError::Open { path, why },
        }
    }
}

/// What can be read from any place.
pub trait Archive: Read + Seek {}

impl<R: Read + Seek> Archive for R {}

fn unpacked(file: File) -> io::Result<impl Read> {
    let packed = file.metadata()?.len();
    let blocks = BufReader::with_capacity(BLOCK, file);
    Ok(Unpacked::of(packed, MultiGzDecoder::new(blocks)))
}
