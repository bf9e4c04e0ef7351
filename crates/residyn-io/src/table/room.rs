//! How much may be made of a packed file: a small one may hold any number of bytes, and a byte may be a number.

use std::io::{self, Read};

use residyn_core::limits::{self, unpacked_bytes};

/// What was made of a file: bytes of what it holds, and 8 bytes for each number that is kept.
#[derive(Debug)]
pub(super) struct Room {
    packed: u64,
    taken: u64,
}

impl Room {
    /// For a file, or a part of one, of so many bytes.
    pub fn of(packed: u64) -> Self {
        Self { packed, taken: 0 }
    }

    /// # Errors
    /// More than may be made of the file, now or before.
    pub fn take(&mut self, bytes: u64) -> io::Result<()> {
        self.taken = self.taken.saturating_add(bytes);
        self.check()
    }

    /// # Errors
    /// More than may be made of the file was taken.
    pub fn check(&self) -> io::Result<()> {
        match self.taken <= unpacked_bytes(self.packed) {
            true => Ok(()),
            false => Err(too_large()),
        }
    }

    /// As [`Room::take`], for so many numbers.
    ///
    /// # Errors
    /// More than may be made of the file, now or before.
    pub fn take_numbers(&mut self, count: u64) -> io::Result<()> {
        self.take(count.saturating_mul(8))
    }
}

/// What recordings ask for.
#[cfg(feature = "recordings")]
impl Room {
    /// One more file.
    pub fn extend(&mut self, packed: u64) {
        self.packed = self.packed.saturating_add(packed);
    }

    /// Bytes of the files as they are.
    pub fn packed(&self) -> u64 {
        self.packed
    }

    /// All that a packed part holds.
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

/// What a packed part holds, as it is unpacked. More than may be unpacked is an error where it is reached.
pub(super) struct Unpacked<R> {
    part: R,
    room: Room,
}

impl<R> Unpacked<R> {
    /// Of a file of so many bytes.
    pub fn of(packed: u64, part: R) -> Self {
        Self {
            part,
            room: Room::of(packed),
        }
    }
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.part.read(bytes)?;
        self.room.take(read as u64)?;
        Ok(read)
    }
}

/// What holds more than is unpacked.
pub fn too_large() -> io::Error {
    io::Error::other(limits::too_large())
}

#[cfg(all(test, feature = "recordings"))]
mod tests {
    use super::Room;

    #[test]
    fn bytes_and_numbers_share_what_may_be_made_of_a_file() {
        let mut room = Room::of(0);
        room.extend(1);
        room.take(1 << 24).unwrap();
        room.take_numbers(2).unwrap();
        assert_eq!(room.read(&b"four"[..]).unwrap(), b"four");
        assert!(room.read(&b""[..]).unwrap().is_empty());
        let told = room.read(std::io::repeat(0)).unwrap_err().to_string();
        assert!(
            told.contains("more than 16 MB and 20 times its size"),
            "{told}"
        );
        assert!(room.check().is_err() && Room::of(0).take_numbers(u64::MAX).is_err());
    }
}
