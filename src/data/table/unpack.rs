//! Unpacking: a small file may hold any number of bytes, of which a part is taken.

use std::io::{self, Read};

use crate::limits::{UNPACKED_BYTES, UNPACKED_RATIO, unpacked_bytes};

/// What may still be unpacked of a file.
pub(super) struct Unpacking {
    left: u64,
}

impl Unpacking {
    /// Of a file, or a part of one, of so many bytes.
    pub fn of(packed: u64) -> Self {
        Self {
            left: unpacked_bytes(packed),
        }
    }

    /// All that a packed part holds.
    ///
    /// # Errors
    /// A part that is damaged, or that holds more than may still be unpacked.
    pub fn read(&mut self, part: impl Read) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut part = Unpacked {
            part,
            left: self.left,
        };
        part.read_to_end(&mut bytes)?;
        self.left = part.left;
        Ok(bytes)
    }
}

/// What a packed part holds, as it is unpacked. More than may be unpacked is an error where it is reached.
pub(super) struct Unpacked<R> {
    part: R,
    left: u64,
}

impl<R> Unpacked<R> {
    /// Of a file of so many bytes.
    pub fn of(packed: u64, part: R) -> Self {
        Self {
            part,
            left: unpacked_bytes(packed),
        }
    }
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.part.read(bytes)?;
        let left = self.left.checked_sub(read as u64);
        self.left = left.ok_or_else(too_large)?;
        Ok(read)
    }
}

/// What holds more than is unpacked.
pub(super) fn too_large() -> io::Error {
    io::Error::other(format!(
        "it holds more than {} MB and {UNPACKED_RATIO} times its size when it is unpacked; unpack it first",
        UNPACKED_BYTES >> 20
    ))
}

#[cfg(test)]
mod tests {
    use super::Unpacking;

    #[test]
    fn parts_share_what_a_file_may_hold() {
        let mut unpacking = Unpacking::of(1);
        let part = || std::io::repeat(0);
        assert_eq!(
            unpacking
                .read(std::io::Read::take(part(), 1 << 24))
                .unwrap()
                .len(),
            1 << 24
        );
        assert_eq!(
            unpacking
                .read(std::io::Read::take(part(), 20))
                .unwrap()
                .len(),
            20
        );
        assert!(unpacking.read(&b""[..]).unwrap().is_empty());
        let told = unpacking.read(part()).unwrap_err().to_string();
        assert!(
            told.contains("more than 16 MB and 20 times its size"),
            "{told}"
        );
    }
}
