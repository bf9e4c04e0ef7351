//! A file that is read from its beginning as often as needed, and never all at once.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use super::budget::Unpacked;
use crate::files;
use residyn_core::data::LogError;

/// The first bytes of gzip files.
const GZIP: &[u8] = b"\x1f\x8b";

/// Bytes that are read from a file at once.
pub(super) const BLOCK: usize = 1 << 16;

/// A file, unpacked if it is packed with gzip.
pub struct Source {
    path: PathBuf,
    size: u64,
    is_packed: bool,
}

impl Source {
    /// # Errors
    /// A file that cannot be read.
    pub fn of(path: &Path) -> Result<Self, LogError> {
        let mut begin = Vec::new();
        let size = files::open(path).and_then(|file| {
            let size = file.metadata()?.len();
            file.take(GZIP.len() as u64).read_to_end(&mut begin)?;
            Ok(size)
        });
        Ok(Self {
            path: path.to_owned(),
            size: size.map_err(LogError::open(path))?,
            is_packed: begin == GZIP,
        })
    }

    /// Whether the file is packed.
    pub fn is_packed(&self) -> bool {
        self.is_packed
    }

    /// Its size as stored, packed or not \[bytes\].
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Its contents, from the beginning.
    ///
    /// # Errors
    /// A file that cannot be opened.
    pub fn open(&self) -> io::Result<Box<dyn Read>> {
        let file = files::open(&self.path)?;
        match self.is_packed {
            true => Ok(Box::new(unpacked(self.size, file))),
            false => Ok(Box::new(file)),
        }
    }

    /// Its first bytes.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn begin(&self) -> Result<Vec<u8>, LogError> {
        let mut bytes = Vec::new();
        let read = |source: Box<dyn Read>| source.take(16).read_to_end(&mut bytes);
        let read = self.open().and_then(read);
        read.map_err(|why| self.fault(&self.path, why))?;
        Ok(bytes)
    }

    /// Why it cannot be read, by the name that its user gave it.
    pub fn fault(&self, path: &Path, why: io::Error) -> LogError {
        match self.is_packed {
            true => LogError::form(path, format!("cannot be unpacked: {why}")),
            false => LogError::open(path)(why),
        }
    }
}

fn unpacked(packed: u64, file: File) -> impl Read {
    let blocks = BufReader::with_capacity(BLOCK, file);
    Unpacked::of(packed, MultiGzDecoder::new(blocks))
}
