//! NumPy arrays (format versions 1 to 3, numpy.lib.format): a dictionary of three Python literals, then the numbers.
//! Parsed here because the available crates bring a parser generator and C code for those three literals.

#![warn(clippy::indexing_slicing)]

use std::io::{self, BufReader, ErrorKind, Read};
use std::path::Path;

use super::arrays::Unpacked;
use super::budget::Budget;
use super::source::Source;
use residyn_core::data::{Arrays, LogError};
use residyn_core::limits::LOG_COLUMNS;

/// An array whose numbers are still to be read.
pub(super) struct Array<R> {
    /// `<f8`
    pub kind: String,
    /// Whether it is stored by columns rather than by rows.
    pub by_columns: bool,
    pub shape: Vec<usize>,
    pub numbers: R,
}

pub(super) const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// The longest header; NumPy itself refuses more than 10 000 bytes by default.
const HEADER: usize = 1 << 16;

/// The matrix in a file, one row per sample: columns 1, 2 ..
///
/// # Errors
/// A file that is damaged, or holds something else than numbers.
pub(super) fn read(path: &Path, source: &Source) -> Result<Arrays, LogError> {
    let bytes = source.open().map_err(|why| source.fault(path, why))?;
    let mut table = Unpacked::of(source.size());
    let array = Array::of(bytes).filter(|array| array.shape.len() == 2);
    let array = array.ok_or_else(|| {
        let fault = "is not a matrix of NumPy; save one row per sample, and one column per channel";
        LogError::form(path, fault)
    })?;
    match table.add("", array) {
        Ok(()) => Ok(table.table),
        Err(fault) => Err(LogError::form(path, fault)),
    }
}

impl<R: Read> Array<R> {
    /// `None` if it is not an array.
    pub fn of(mut bytes: R) -> Option<Self> {
        let [magic @ .., version, _] = take::<8>(&mut bytes)?;
        let length = match version {
            1 => usize::from(u16::from_le_bytes(take(&mut bytes)?)),
            _ => usize::try_from(u32::from_le_bytes(take(&mut bytes)?)).ok()?,
        };
        if magic != *MAGIC || length > HEADER {
            return None;
        }
        let mut header = vec![0; length];
        bytes.read_exact(&mut header).ok()?;
        let header = String::from_utf8(header).ok()?;
        // `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }`
        let after = |key: &str| Some(header.split_once(&format!("'{key}':"))?.1.trim_start());
        let shape = after("shape")?.strip_prefix('(')?.split_once(')')?.0;
        let sizes = shape
            .split(',')
            .map(str::trim)
            .filter(|size| !size.is_empty());
        Some(Self {
            kind: kind(after("descr")?).to_owned(),
            by_columns: after("fortran_order")?.starts_with("True"),
            shape: sizes.map(|size| size.parse().ok()).collect::<Option<_>>()?,
            numbers: bytes,
        })
    }

    /// Whether it holds texts.
    fn is_text(&self) -> bool {
        self.kind.starts_with("<U") || self.kind.starts_with("|S")
    }

    /// Its columns: one for a vector or a single number, as many as it has for a matrix with one row per sample; none for
    /// other arrays or for texts. Objects are refused unread, since reading them runs the code that they name.
    ///
    /// # Errors
    /// An array that holds something else, has too many columns or numbers, or is cut off.
    #[allow(clippy::cast_precision_loss)] // logged integers are far below 2^53
    pub fn columns(self, name: &str, budget: &mut Budget) -> Result<Vec<Vec<f64>>, String> {
        if self.is_text() || self.shape.len() > 2 {
            return Ok(Vec::new());
        }
        let columns = match self.kind.as_str() {
            "<f8" => self.each(budget, f64::from_le_bytes),
            "<f4" => self.each(budget, |bytes| f64::from(f32::from_le_bytes(bytes))),
            "<i8" => self.each(budget, |bytes| i64::from_le_bytes(bytes) as f64),
            "<i4" => self.each(budget, |bytes| f64::from(i32::from_le_bytes(bytes))),
            "<i2" => self.each(budget, |bytes| f64::from(i16::from_le_bytes(bytes))),
            "<u8" => self.each(budget, |bytes| u64::from_le_bytes(bytes) as f64),
            "<u4" => self.each(budget, |bytes| f64::from(u32::from_le_bytes(bytes))),
            "<u2" => self.each(budget, |bytes| f64::from(u16::from_le_bytes(bytes))),
            "|u1" | "|b1" => self.each(budget, |[byte]| f64::from(byte)),
            "|i1" => self.each(budget, |byte| f64::from(i8::from_le_bytes(byte))),
            "|O" => Err(
                "holds pickled objects, which are never read, since they can run any code; save arrays of numbers"
                    .to_owned(),
            ),
            kind => Err(format!(
                "holds `{kind}`; save it as numbers, such as array.astype(float)"
            )),
        };
        columns.map_err(|fault| format!("array {name:?} {fault}"))
    }

    fn each<const SIZE: usize>(
        self,
        budget: &mut Budget,
        number: impl Fn([u8; SIZE]) -> f64,
    ) -> Result<Vec<Vec<f64>>, String> {
        let length = |axis: usize| self.shape.get(axis).copied().unwrap_or(1);
        let columns = length(1);
        // Rows without cells do not count.
        let rows = if columns == 0 { 0 } else { length(0) };
        if columns > LOG_COLUMNS {
            return Err(format!(
                "has {columns} columns; at most {LOG_COLUMNS} are read"
            ));
        }
        let count = (rows as u64).saturating_mul(columns as u64);
        budget
            .take_numbers(count)
            .map_err(|why| format!("is too large: {why}"))?;
        let mut all: Vec<Vec<f64>> = (0..columns).map(|_| Vec::with_capacity(rows)).collect();
        let mut numbers = BufReader::new(self.numbers);
        let mut read = |column: &mut Vec<f64>| {
            let mut cell = [0; SIZE];
            numbers.read_exact(&mut cell)?;
            column.push(number(cell));
            Ok(())
        };
        let whole = match self.by_columns {
            true => all
                .iter_mut()
                .try_for_each(|column| (0..rows).try_for_each(|_| read(column))),
            false => (0..rows).try_for_each(|_| all.iter_mut().try_for_each(&mut read)),
        };
        let unreadable = |why: io::Error| format!("cannot be read: {why}");
        whole.map_err(|why: io::Error| match why.kind() {
            ErrorKind::UnexpectedEof => {
                let found: usize = all.iter().map(Vec::len).sum();
                format!("is cut off at {found} numbers; write the file again")
            }
            _ => unreadable(why),
        })?;
        // Checksum errors are reported where the numbers end.
        match numbers.bytes().next().transpose() {
            Ok(None) => Ok(all),
            Ok(Some(_)) => Err(format!(
                "holds more than its {count} numbers; write the file again"
            )),
            Err(why) => Err(unreadable(why)),
        }
    }
}

/// The next bytes; `None` if there are too few.
fn take<const SIZE: usize>(bytes: &mut impl Read) -> Option<[u8; SIZE]> {
    let mut taken = [0; SIZE];
    bytes.read_exact(&mut taken).ok()?;
    Some(taken)
}

/// The text in quotes, or all of a description of fields, which is not quoted.
fn kind(described: &str) -> &str {
    let quoted = described.strip_prefix('\'');
    let quoted = quoted.and_then(|rest| rest.split_once('\''));
    quoted.map_or(described, |(kind, _)| kind)
}
