//! A Parquet file that its reader can trust. Reading beyond the end is an error: the reader would search there for the
//! bytes that a damaged length claims, one at a time, up to 2^31 times. The metadata of the file and its pages are
//! checked before the reader sees them.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};

use bytes::Bytes;
use parquet::errors::Result;
use parquet::file::reader::{ChunkReader, Length};

use super::thrift;

pub(super) struct Ending(File);

/// The length of the description before it, and how the file ends.
const FOOTER: u64 = 8;

impl Ending {
    /// # Errors
    /// A file whose description is cut off or damaged.
    pub fn of(file: File) -> Result<Self> {
        let file = Self(file);
        // The reader reports a file without a footer.
        let Some(footer) = file.len().checked_sub(FOOTER) else {
            return Ok(file);
        };
        let mut length = [0; 4];
        file.up_to_end(footer)?.read_exact(&mut length)?;
        if let Some(start) = footer.checked_sub(u32::from_le_bytes(length).into()) {
            thrift::pass(&mut file.up_to_end(start)?)?;
        }
        Ok(file)
    }

    fn up_to_end(&self, start: u64) -> Result<UpToEnd> {
        self.0.get_read(start).map(UpToEnd)
    }
}

impl Length for Ending {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for Ending {
    type T = UpToEnd;

    /// This reads the footer, or data that begin with the description of a page.
    fn get_read(&self, start: u64) -> Result<UpToEnd> {
        if start.checked_add(FOOTER) != Some(self.len()) {
            thrift::pass(&mut self.up_to_end(start)?)?;
        }
        self.up_to_end(start)
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        self.0.get_bytes(start, length)
    }
}

pub(super) struct UpToEnd(BufReader<File>);

impl Read for UpToEnd {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.0.read(bytes)? {
            0 if !bytes.is_empty() => Err(ErrorKind::UnexpectedEof.into()),
            read => Ok(read),
        }
    }
}
