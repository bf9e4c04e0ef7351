//! NumPy arrays (format versions 1 to 3, numpy.lib.format): a dictionary of three Python literals, then the numbers. Read here,
//! since the crates that do it bring a parser generator and C code for those three.

#![warn(clippy::indexing_slicing)]

use crate::limits::LOG_COLUMNS;

/// An array whose numbers are still to be read.
pub(super) struct Array<'a> {
    /// `<f8`
    pub kind: &'a str,
    /// Whether a column follows the other, rather than a row.
    pub by_columns: bool,
    pub shape: Vec<usize>,
    pub numbers: &'a [u8],
}

const MAGIC: &[u8] = b"\x93NUMPY";

impl<'a> Array<'a> {
    /// `None` for what is no array.
    pub fn of(bytes: &'a [u8]) -> Option<Self> {
        let ([version, _], rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk()?;
        let (length, rest) = match *version {
            1 => rest.split_at_checked(2)?,
            _ => rest.split_at_checked(4)?,
        };
        let little_endian = |sum, byte: &u8| 256 * sum + usize::from(*byte);
        let length = length.iter().rev().fold(0, little_endian);
        let (header, numbers) = rest.split_at_checked(length)?;
        let header = std::str::from_utf8(header).ok()?;
        // `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }`
        let after = |key: &str| Some(header.split_once(&format!("'{key}':"))?.1.trim_start());
        let shape = after("shape")?.strip_prefix('(')?.split_once(')')?.0;
        let sizes = shape
            .split(',')
            .map(str::trim)
            .filter(|size| !size.is_empty());
        Some(Self {
            kind: kind(after("descr")?),
            by_columns: after("fortran_order")?.starts_with("True"),
            shape: sizes.map(|size| size.parse().ok()).collect::<Option<_>>()?,
            numbers,
        })
    }

    /// Whether it holds texts.
    fn is_text(&self) -> bool {
        self.kind.starts_with("<U") || self.kind.starts_with("|S")
    }

    /// Its columns: one of a vector, of a matrix as many as it has, a row a sample; none of what is neither, or of texts. Objects
    /// are refused unread: to read them is to run the code that they name.
    ///
    /// # Errors
    /// An array that holds something else, has too many columns, or is cut off.
    #[allow(clippy::cast_precision_loss)] // integers of loggers are far below 2^53
    pub fn columns(&self, name: &str) -> Result<Vec<Vec<f64>>, String> {
        if self.is_text() || !(1..=2).contains(&self.shape.len()) {
            return Ok(Vec::new());
        }
        match self.kind {
            "<f8" => self.each(name, f64::from_le_bytes),
            "<f4" => self.each(name, |bytes| f64::from(f32::from_le_bytes(bytes))),
            "<i8" => self.each(name, |bytes| i64::from_le_bytes(bytes) as f64),
            "<i4" => self.each(name, |bytes| f64::from(i32::from_le_bytes(bytes))),
            "<i2" => self.each(name, |bytes| f64::from(i16::from_le_bytes(bytes))),
            "<u8" => self.each(name, |bytes| u64::from_le_bytes(bytes) as f64),
            "<u4" => self.each(name, |bytes| f64::from(u32::from_le_bytes(bytes))),
            "|u1" | "|b1" => self.each(name, |[byte]| f64::from(byte)),
            "|i1" => self.each(name, |byte| f64::from(i8::from_le_bytes(byte))),
            "<u2" => self.each(name, |bytes| f64::from(u16::from_le_bytes(bytes))),
            "|O" => Err(format!(
                "array {name:?} holds pickled objects, which are never read, since they can run any code; save arrays of numbers"
            )),
            kind => Err(format!(
                "array {name:?} holds `{kind}`; save it as numbers, such as array.astype(float)"
            )),
        }
    }

    fn each<const SIZE: usize>(
        &self,
        name: &str,
        number: impl Fn([u8; SIZE]) -> f64,
    ) -> Result<Vec<Vec<f64>>, String> {
        let (cells, _) = self.numbers.as_chunks::<SIZE>();
        let length = |axis: usize| self.shape.get(axis).copied().unwrap_or(1);
        let (rows, columns) = (length(0), length(1));
        if rows.checked_mul(columns) != Some(cells.len()) {
            return Err(format!(
                "array {name:?} is cut off at {} numbers; write the file again",
                cells.len()
            ));
        }
        if columns > LOG_COLUMNS {
            return Err(format!(
                "array {name:?} has {columns} columns; at most {LOG_COLUMNS} are read"
            ));
        }
        let column = |column: usize| {
            let (first, step) = match self.by_columns {
                true => (column * rows, 1),
                false => (column, columns),
            };
            let cells = cells.get(first..).unwrap_or_default().iter();
            cells
                .step_by(step)
                .take(rows)
                .map(|cell| number(*cell))
                .collect()
        };
        Ok((0..columns).map(column).collect())
    }
}

/// What stands in quotes, or all of a description of fields, which has none around it.
fn kind(described: &str) -> &str {
    let quoted = described.strip_prefix('\'');
    let quoted = quoted.and_then(|rest| rest.split_once('\''));
    quoted.map_or(described, |(kind, _)| kind)
}
