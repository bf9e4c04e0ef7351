//! NumPy arrays (format versions 1 to 3, numpy.lib.format): a dictionary of three Python literals, then the numbers. Read here,
//! since the crates that do it bring a parser generator and C code for those three.

#![warn(clippy::indexing_slicing)]

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
    pub fn is_text(&self) -> bool {
        self.kind.starts_with("<U") || self.kind.starts_with("|S")
    }

    /// In the order of the file. Objects are refused unread: to read them is to run the code that they name.
    #[allow(clippy::cast_precision_loss)] // integers of loggers are far below 2^53
    pub fn numbers(&self, name: &str) -> Result<Vec<f64>, String> {
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
    ) -> Result<Vec<f64>, String> {
        let (cells, _) = self.numbers.as_chunks::<SIZE>();
        let mut sizes = self.shape.iter();
        let wanted = sizes.try_fold(1_usize, |size, n| size.checked_mul(*n));
        match wanted == Some(cells.len()) {
            true => Ok(cells.iter().map(|cell| number(*cell)).collect()),
            false => Err(format!(
                "array {name:?} is cut off at {} numbers; write the file again",
                cells.len()
            )),
        }
    }
}

/// What stands in quotes, or all of a description of fields, which has none around it.
fn kind(described: &str) -> &str {
    let quoted = described.strip_prefix('\'');
    let quoted = quoted.and_then(|rest| rest.split_once('\''));
    quoted.map_or(described, |(kind, _)| kind)
}
