//! How much may be unpacked from a compressed file: a small file may hold any number of bytes, each of which may be a
//! number.

use std::io::{self, Read};

use residyn_core::limits::{self, unpacked_bytes};

/// What was unpacked from a file: its bytes, and 8 bytes for each number that is kept.
#[derive(Debug)]
pub(super) struct Budget {
    packed: u64,
    taken: u64,
}

impl Budget {
    /// For a file, or a part of one, of `packed` bytes.
    pub fn of(packed: u64) -> Self {
        Self { packed, taken: 0 }
    }

    /// # Errors
    /// More than may be unpacked from the file, now or before.
    pub fn take(&mut self, bytes: u64) -> io::Result<()> {
        self.taken = self.taken.saturating_add(bytes);
        self.check()
    }

    /// # Errors
    /// More than may be unpacked from the file was taken.
    pub fn check(&self) -> io::Result<()> {
        match self.taken <= unpacked_bytes(self.packed) {
            true => Ok(()),
            false => Err(too_large()),
        }
    }

    /// As [`Budget::take`], for `count` numbers.
    ///
    /// # Errors
    /// More than may be unpacked from the file, now or before.
    pub fn take_numbers(&mut self, count: u64) -> io::Result<()> {
        self.take(count.saturating_mul(8))
    }
}

/// Methods for recordings.
#[cfg(feature = "recordings")]
impl Budget {
    /// One more file.
    pub fn extend(&mut self, packed: u64) {
        self.packed = self.packed.saturating_add(packed);
    }

    /// Bytes of the files as stored.
    pub fn packed(&self) -> u64 {
        self.packed
    }

    /// The contents of a packed part.
    ///
    /// # Errors
    /// A part that is damaged, or that holds more than there is room for.
    pub fn read(&mut self, part: impl Read) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let left = unpacked_bytes(self.packed).saturating_sub(self.taken);
        part.take(left.saturating_add(1)).read_to_end(&mut bytes)?;
        self.take(bytes.len() as u64)?;
        Ok(bytes)
    }
}

/// The contents of a packed part, as it is unpacked. Exceeding the budget is an error once that point is reached.
pub(super) struct Unpacked<R> {
    part: R,
    budget: Budget,
}

impl<R> Unpacked<R> {
    /// For a file of `packed` bytes.
    pub fn of(packed: u64, part: R) -> Self {
        Self {
            part,
            budget: Budget::of(packed),
        }
    }
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.part.read(bytes)?;
        self.budget.take(read as u64)?;
        Ok(read)
    }
}

/// The error for a file that holds more than is unpacked.
pub fn too_large() -> io::Error {
    io::Error::other(limits::too_large())
}

#[cfg(test)]
#[cfg(feature = "recordings")]
mod tests {
    use super::Budget;

    #[test]
    fn bytes_and_numbers_share_what_may_be_made_of_a_file() {
        let mut budget = Budget::of(0);
        budget.extend(1);
        budget.take(1 << 24).unwrap();
        budget.take_numbers(2).unwrap();
        assert_eq!(budget.read(&b"four"[..]).unwrap(), b"four");
        assert!(budget.read(&b""[..]).unwrap().is_empty());
        let message = budget.read(std::io::repeat(0)).unwrap_err().to_string();
        assert!(
            message.contains("more than 16 MB and 20 times its size"),
            "{message}"
        );
        assert!(budget.check().is_err() && Budget::of(0).take_numbers(u64::MAX).is_err());
    }
}
