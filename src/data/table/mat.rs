//! MATLAB's files of versions 5 to 7: data elements of type, size and bytes, packed with zlib or not. Read here, since of the
//! crates that do it one prints what it does not know and passes over what is damaged, and the other is a serializer.

#![warn(clippy::indexing_slicing)]

use std::path::Path;

use flate2::read::ZlibDecoder;

use super::arrays::Arrays;
use super::npy::Array;
use super::unpack::Unpacking;
use crate::data::error::LogError;

/// How these files begin; those of version 7.3 are HDF5.
pub(super) const MAGIC: &[u8] = b"MATLAB 5.0";

/// # Errors
/// A file that is cut off or damaged.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Arrays, LogError> {
    table(bytes).map_err(|fault| LogError::Form {
        path: path.to_owned(),
        fault: format!("{fault}; save it again: save('run.mat', 'time', 'q', 'qd', 'tau', '-v7')"),
    })
}

/// A text, an offset, a version and the order of bytes.
const HEADER: usize = 128;

fn table(bytes: &[u8]) -> Result<Arrays, String> {
    let Some((header, mut rest)) = bytes.split_at_checked(HEADER) else {
        return Err(cut_off());
    };
    if !header.ends_with(b"IM") {
        return Err("its numbers are not in little-endian order".to_owned());
    }
    let mut table = Arrays::default();
    let mut unpacking = Unpacking::of(bytes.len() as u64);
    while !rest.is_empty() {
        let (element, behind) = element(rest).ok_or_else(cut_off)?;
        match element.kind {
            PACKED => {
                let unpacked = unpacking.read(ZlibDecoder::new(element.bytes));
                let unpacked = unpacked.map_err(|why| format!("is damaged: {why}"))?;
                let (element, _) = self::element(&unpacked).ok_or_else(cut_off)?;
                add(&mut table, &element)?;
            }
            _ => add(&mut table, &element)?,
        }
        rest = behind;
    }
    Ok(table)
}

fn cut_off() -> String {
    "is cut off".to_owned()
}

/// What the bytes of an element are: one of [`NUMBERS`], or these.
const MATRIX: u32 = 14;
const PACKED: u32 = 15;

/// Types of numbers, and what NumPy calls them.
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

struct Element<'a> {
    kind: u32,
    bytes: &'a [u8],
}

/// The first element, and what follows it.
fn element(bytes: &[u8]) -> Option<(Element<'_>, &[u8])> {
    let (word, rest) = bytes.split_first_chunk()?;
    let word = u32::from_le_bytes(*word);
    // Up to four bytes stand beside their type and size.
    if word >> 16 != 0 {
        let (bytes, rest) = rest.split_at_checked(4)?;
        let bytes = bytes.get(..(word >> 16) as usize)?;
        let kind = word & 0xffff;
        return Some((Element { kind, bytes }, rest));
    }
    let (size, rest) = rest.split_first_chunk()?;
    let (bytes, rest) = rest.split_at_checked(u32::from_le_bytes(*size) as usize)?;
    // All but packed elements are filled up to eight bytes, but for the last.
    let padding = match word {
        PACKED => 0,
        _ => bytes.len().next_multiple_of(8) - bytes.len(),
    };
    let rest = rest.get(padding..).unwrap_or_default();
    Some((Element { kind: word, bytes }, rest))
}

/// The columns of a matrix of real numbers; structures, cells and texts are left out.
fn add(table: &mut Arrays, element: &Element<'_>) -> Result<(), String> {
    if element.kind != MATRIX || element.bytes.is_empty() {
        return Ok(());
    }
    let matrix = Matrix::of(element.bytes).ok_or_else(cut_off)?;
    let name = String::from_utf8_lossy(matrix.name);
    match matrix.array() {
        Some(array) => table.add_array(&name, &array),
        None => Ok(()),
    }
}

struct Matrix<'a> {
    /// Of all numbers 6 (double) to 15.
    class: u8,
    sizes: &'a [u8],
    name: &'a [u8],
    /// Everything behind the name.
    data: &'a [u8],
}

impl<'a> Matrix<'a> {
    fn of(bytes: &'a [u8]) -> Option<Self> {
        let (flags, rest) = element(bytes)?;
        let (sizes, rest) = element(rest)?;
        let (name, data) = element(rest)?;
        Some(Self {
            class: *flags.bytes.first()?,
            sizes: sizes.bytes,
            name: name.bytes,
            data,
        })
    }

    /// `None` for what is no matrix of numbers. One row or one column is a vector.
    fn array(&self) -> Option<Array<'a>> {
        let (sizes, _) = self.sizes.as_chunks();
        let sizes = sizes.iter().map(|size| u32::from_le_bytes(*size) as usize);
        let shape = match *sizes.collect::<Vec<_>>().as_slice() {
            [1, length] | [length, 1] => vec![length],
            [rows, columns] => vec![rows, columns],
            _ => return None,
        };
        if !(6..=15).contains(&self.class) {
            return None;
        }
        let (numbers, _) = element(self.data)?;
        let (_, kind) = NUMBERS.iter().find(|(kind, _)| *kind == numbers.kind)?;
        Some(Array {
            kind,
            by_columns: true,
            shape,
            numbers: numbers.bytes,
        })
    }
}
