//! Bytes that are read from their beginning as often as needed: those of a file, never all at once, or those that came
//! from elsewhere.

use std::io::{self, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::bufread::MultiGzDecoder;

use super::budget::Unpacked;
use crate::files;
use residyn_core::data::LogError;
use residyn_core::limits::SAVED_BYTES;

/// The first bytes of gzip files.
const GZIP: &[u8] = b"\x1f\x8b";

/// Bytes that are read from a file at once.
pub(super) const BLOCK: usize = 1 << 16;

/// The bytes of a table, unpacked if they are packed with gzip.
pub struct Source {
    bytes: Bytes,
    size: u64,
    is_packed: bool,
}

enum Bytes {
    Of(PathBuf),
    Held(Arc<[u8]>),
}

impl Source {
    /// # Errors
    /// A file that cannot be read.
    pub fn of(path: &Path) -> Result<Self, LogError> {
        let size = || Ok(files::open(path)?.metadata()?.len());
        Self::new(path, size().map(|size| (Bytes::Of(path.to_owned()), size)))
    }

    /// What a reader has to its end, held in memory: it may be a pipe, which is read only once. `name` is for messages.
    ///
    /// # Errors
    /// A reader that fails, or that has more than [`SAVED_BYTES`].
    pub fn held(name: &Path, reader: impl Read) -> Result<Self, LogError> {
        let mut bytes = Vec::new();
        let read = reader.take(SAVED_BYTES + 1).read_to_end(&mut bytes);
        let size = bytes.len() as u64;
        if size > SAVED_BYTES {
            let most = SAVED_BYTES >> 20;
            let fault = format!("has more than {most} MB; write it to a file");
            return Err(LogError::form(name, fault));
        }
        Self::new(name, read.map(|_| (Bytes::Held(bytes.into()), size)))
    }

    fn new(name: &Path, bytes: io::Result<(Bytes, u64)>) -> Result<Self, LogError> {
        let mut begin = Vec::new();
        let read = bytes.and_then(|(bytes, size)| {
            let mut first = bytes.open()?.take(GZIP.len() as u64);
            first.read_to_end(&mut begin)?;
            Ok((bytes, size))
        });
        let (bytes, size) = read.map_err(LogError::open(name))?;
        Ok(Self {
            bytes,
            size,
            is_packed: begin == GZIP,
        })
    }

    /// The file, if it is one that is not packed.
    pub fn plain_file(&self) -> Option<&Path> {
        match &self.bytes {
            Bytes::Of(path) if !self.is_packed => Some(path),
            _ => None,
        }
    }

    /// Whether the bytes are packed.
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
        let bytes = self.bytes.open()?;
        match self.is_packed {
            true => Ok(Box::new(unpacked(self.size, bytes))),
            false => Ok(bytes),
        }
    }

    /// Its first bytes; `name` is for messages.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn begin(&self, name: &Path) -> Result<Vec<u8>, LogError> {
        let mut bytes = Vec::new();
        let read = |source: Box<dyn Read>| source.take(16).read_to_end(&mut bytes);
        let read = self.open().and_then(read);
        read.map_err(|why| self.fault(name, why))?;
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

impl Bytes {
    fn open(&self) -> io::Result<Box<dyn Read>> {
        Ok(match self {
            Self::Of(path) => Box::new(files::open(path)?),
            Self::Held(bytes) => Box::new(Cursor::new(Arc::clone(bytes))),
        })
    }
}

fn unpacked(packed: u64, bytes: impl Read) -> impl Read {
    let blocks = BufReader::with_capacity(BLOCK, bytes);
    Unpacked::of(packed, MultiGzDecoder::new(blocks))
}
