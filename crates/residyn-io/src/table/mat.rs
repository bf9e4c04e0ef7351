//! MATLAB files, versions 5 to 7: data elements of type, size and bytes, with or without zlib compression. Parsed here
//! because, of the available crates, one prints what it does not know and skips damaged data, and the other is a
//! serializer.

#![warn(clippy::indexing_slicing)]

use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Read};
use std::path::Path;

use flate2::read::ZlibDecoder;

use residyn_core::data::{Arrays, LogError};

use super::arrays::Unpacked;
use super::npy::Array;
use super::source::{BLOCK, Source};

/// How these files begin; those of version 7.3 are HDF5.
pub(super) const MAGIC: &[u8] = b"MATLAB 5.0";

/// # Errors
/// A file that is cut off or damaged.
pub(super) fn read(path: &Path, source: &Source) -> Result<Arrays, LogError> {
    let bytes = source.open().map_err(|why| source.fault(path, why))?;
    let mut table = Unpacked::of(source.size());
    let bytes = BufReader::with_capacity(BLOCK, bytes);
    match add_all(&mut table, bytes) {
        Ok(()) => Ok(table.table),
        Err(fault) => Err(LogError::form(
            path,
            format!("{fault}; save it again: save('run.mat', 'time', 'q', 'qd', 'tau', '-v7')"),
        )),
    }
}

/// A text, an offset, a version and the byte order.
const HEADER: usize = 128;

fn add_all(table: &mut Unpacked, mut bytes: impl BufRead) -> Result<(), String> {
    let mut header = [0; HEADER];
    bytes.read_exact(&mut header).map_err(fault)?;
    if !header.ends_with(b"IM") {
        return Err("its numbers are not in little-endian order".to_owned());
    }
    while !bytes.fill_buf().map_err(fault)?.is_empty() {
        let mut element = Element::of(&mut bytes).map_err(fault)?;
        match element.kind {
            PACKED => {
                let mut packed = ZlibDecoder::new(&mut element.bytes);
                add(table, &mut Element::of(&mut packed).map_err(fault)?)?;
            }
            _ => add(table, &mut element)?,
        }
        element.pass().map_err(fault)?;
    }
    Ok(())
}

fn fault(why: io::Error) -> String {
    match why.kind() {
        ErrorKind::UnexpectedEof => "is cut off".to_owned(),
        _ => format!("is damaged: {why}"),
    }
}

/// Types of an element: one of [`NUMBERS`], or these.
const MATRIX: u32 = 14;
const PACKED: u32 = 15;

/// Types of numbers, and their names in NumPy.
const NUMBERS: [(u32, &str); 10] = [
    (1, "|i1"),
    (2, "|u1"),
    (3, "<i2"),
    (4, "<u2"),
    (5, "<i4"),
    (6, "<u4"),
    (7, "<f4"),
    (9, "<f8"),
    (12, "<i8"),
    (13, "<u8"),
];

/// An element, whose bytes are read one after the other.
struct Element<'a> {
    kind: u32,
    /// Up to four bytes next to their type and size, or those that follow.
    bytes: io::Chain<io::Take<Cursor<[u8; 4]>>, io::Take<&'a mut dyn Read>>,
    /// Bytes between it and the next.
    padding: u64,
}

impl<'a> Element<'a> {
    /// The next element.
    fn of(bytes: &'a mut dyn Read) -> io::Result<Self> {
        let (word, next) = (u32::from_le_bytes(word(bytes)?), word(bytes)?);
        let (kind, beside, size) = match word >> 16 {
            0 => (word, 0, u64::from(u32::from_le_bytes(next))),
            beside => (word & 0xffff, u64::from(beside), 0),
        };
        Ok(Self {
            kind,
            bytes: Cursor::new(next).take(beside).chain(bytes.take(size)),
            // All but packed elements are padded to eight bytes.
            padding: match kind {
                PACKED => 0,
                _ => size.next_multiple_of(8) - size,
            },
        })
    }

    /// Whether it has no bytes left.
    fn is_empty(&self) -> bool {
        let (beside, behind) = self.bytes.get_ref();
        beside.limit() == 0 && behind.limit() == 0
    }

    /// All bytes of a short element, up to the next.
    fn whole(mut self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.bytes.by_ref().take(SHORT).read_to_end(&mut bytes)?;
        self.pass()?;
        Ok(bytes)
    }

    /// Skips what is not read yet.
    fn pass(mut self) -> io::Result<()> {
        io::copy(&mut self.bytes, &mut io::sink())?;
        if !self.is_empty() {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        let (_, behind) = self.bytes.into_inner();
        // The last element is not always padded.
        io::copy(&mut behind.into_inner().take(self.padding), &mut io::sink())?;
        Ok(())
    }
}

fn word(bytes: &mut dyn Read) -> io::Result<[u8; 4]> {
    let mut word = [0; 4];
    bytes.read_exact(&mut word)?;
    Ok(word)
}

/// Bytes of names, sizes and flags that are read.
const SHORT: u64 = 1 << 12;

/// The columns of a matrix of real numbers; structures, cells and texts are left out.
fn add(table: &mut Unpacked, element: &mut Element<'_>) -> Result<(), String> {
    if element.kind != MATRIX || element.is_empty() {
        return Ok(());
    }
    let Some((name, array)) = array(&mut element.bytes).map_err(fault)? else {
        return Ok(());
    };
    table.add(&name, array)
}

/// The array of a matrix, and its name; `None` if it is not a matrix of numbers. One row or one column is a vector.
fn array(matrix: &mut dyn Read) -> io::Result<Option<(String, Array<impl Read>)>> {
    let flags = Element::of(matrix)?.whole()?;
    let sizes = Element::of(matrix)?.whole()?;
    let name = Element::of(matrix)?.whole()?;
    let (sizes, _) = sizes.as_chunks();
    let sizes = sizes.iter().map(|size| u32::from_le_bytes(*size) as usize);
    let shape = match *sizes.collect::<Vec<_>>().as_slice() {
        [1, length] | [length, 1] => vec![length],
        [rows, columns] => vec![rows, columns],
        _ => return Ok(None),
    };
    // The classes of numbers are 6 (double) to 15.
    if !flags.first().is_some_and(|class| (6..=15).contains(class)) {
        return Ok(None);
    }
    let numbers = Element::of(matrix)?;
    let kind = NUMBERS.iter().find(|(kind, _)| *kind == numbers.kind);
    let array = |(_, kind): &(u32, &str)| Array {
        kind: (*kind).to_owned(),
        by_columns: true,
        shape,
        numbers: numbers.bytes,
    };
    let name = String::from_utf8_lossy(&name).into_owned();
    Ok(kind.map(|kind| (name, array(kind))))
}
