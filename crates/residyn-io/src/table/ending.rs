//! A Parquet file beyond whose end nothing is read: its reader would search there for what a damaged length claims, one
//! number at a time, up to 2^31 times.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};

use bytes::Bytes;
use parquet::errors::Result;
use parquet::file::reader::{ChunkReader, Length};

pub(super) struct Ending(pub File);

impl Length for Ending {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for Ending {
    type T = UpToEnd;

    fn get_read(&self, start: u64) -> Result<UpToEnd> {
        self.0.get_read(start).map(UpToEnd)
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
