//! Text tables: CSV and its relatives.
//!
//! Accepted silently: a byte order mark, CRLF line ends, spaces around cells, quoted cells and blank lines. Columns are separated
//! by what the header separates its names by; decimal commas are read where that is no comma.

use std::path::{Path, PathBuf};

use csv::{ReaderBuilder, StringRecord};

use super::Table;
use crate::data::error::{CellFault, LogError, Place};

/// A text, cut into cells.
pub struct Csv {
    path: PathBuf,
    text: String,
    separator: u8,
    head: Place,
    names: Vec<String>,
    rows: Vec<StringRecord>,
}

/// What may separate columns, the most usual first.
const SEPARATORS: [u8; 4] = *b",;\t|";

impl Csv {
    /// # Errors
    /// Bytes that are not UTF-8, and a text without a row.
    pub(super) fn of_bytes(path: &Path, bytes: &[u8]) -> Result<Self, LogError> {
        let text = std::str::from_utf8(bytes).map_err(|error| LogError::NotUtf8 {
            path: path.to_owned(),
            line: line_at(bytes, error.valid_up_to()),
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        Self::of(path, text.to_owned())
    }

    /// # Errors
    /// A text without a row.
    pub fn of(path: &Path, text: String) -> Result<Self, LogError> {
        let separator = separator(&text);
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(separator)
            .from_reader(text.as_bytes());
        let mut rows = vec![];
        for record in reader.records() {
            let record = record.map_err(|why| LogError::Open {
                path: path.to_owned(),
                why: why.into(),
            })?;
            let blank = record.len() == 1 && bare(&record[0]).is_empty();
            if !blank {
                rows.push(record);
            }
        }
        if rows.is_empty() {
            let path = path.to_owned();
            return Err(LogError::Empty { path });
        }
        let header = rows.remove(0);
        Ok(Self {
            path: path.to_owned(),
            head: line(&text, &header),
            names: header.iter().map(|cell| bare(cell).to_owned()).collect(),
            text,
            separator,
            rows,
        })
    }
}

/// What separates the columns of a text: what its first line has most of.
fn separator(text: &str) -> u8 {
    let first = text.lines().find(|line| !line.trim().is_empty());
    let count = |separator: u8| {
        let bytes = first.unwrap_or_default().bytes();
        bytes.filter(|byte| *byte == separator).count()
    };
    // Of equally many, the last is the largest: a comma is where nothing separates.
    let all = SEPARATORS.into_iter().rev();
    all.max_by_key(|separator| count(*separator))
        .unwrap_or(b',')
}

impl Table for Csv {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn head(&self) -> Place {
        self.head
    }

    fn rows(&self) -> usize {
        self.rows.len()
    }

    fn check(&self) -> Result<(), LogError> {
        let expected = self.names.len();
        let is_off = |row: &&StringRecord| row.len() != expected;
        self.rows.iter().find(is_off).map_or(Ok(()), |row| {
            Err(LogError::Width {
                path: self.path.clone(),
                place: line(&self.text, row),
                found: row.len(),
                expected,
            })
        })
    }

    fn number(&self, row: usize, column: usize) -> Result<f64, CellFault> {
        let cell = bare(&self.rows[row][column]);
        let has_comma = self.separator != b',' && cell.contains(',') && !cell.contains('.');
        match has_comma {
            true => number(&cell.replacen(',', ".", 1)),
            false => number(cell),
        }
    }

    fn place(&self, row: usize) -> Place {
        line(&self.text, &self.rows[row])
    }
}

/// A row's line. Found by counting, as only errors ask for it; the reader's own count is behind by one after a CRLF or a blank
/// line.
fn line(text: &str, record: &StringRecord) -> Place {
    let bytes = text.as_bytes();
    let after_previous = record.position().map_or(0, |place| place.byte() as usize);
    let line_ends = bytes[after_previous..]
        .iter()
        .take_while(|byte| matches!(byte, b'\r' | b'\n'));
    Place::Line(line_at(bytes, after_previous + line_ends.count()))
}

/// A cell without the spaces around it, and without quotes that stand behind such spaces, where CSV
/// itself does not take them for quotes.
fn bare(cell: &str) -> &str {
    cell.trim().trim_matches('"').trim()
}

fn number(cell: &str) -> Result<f64, CellFault> {
    // The beginning of a long cell is enough to recognise it.
    let shown = || cell.chars().take(40).collect::<String>();
    match cell.parse::<f64>() {
        _ if cell.is_empty() => Err(CellFault::Empty),
        Err(_) => Err(CellFault::NotANumber(shown())),
        Ok(value) if !value.is_finite() => Err(CellFault::NotFinite(shown())),
        Ok(value) => Ok(value),
    }
}

/// Line of a byte, counted from 1; LF, CRLF and a lone CR each end a line.
fn line_at(bytes: &[u8], offset: usize) -> usize {
    let before = &bytes[..offset];
    let ends_line = |&index: &usize| match before[index] {
        b'\n' => true,
        b'\r' => bytes.get(index + 1) != Some(&b'\n'),
        _ => false,
    };
    1 + (0..before.len()).filter(ends_line).count()
}

#[cfg(test)]
mod tests {
    use super::line_at;

    #[test]
    fn lines_are_counted_as_an_editor_does() {
        assert_eq!(line_at(b"a\r\nb\nc\rd", 0), 1);
        assert_eq!(line_at(b"a\r\nb\nc\rd", 3), 2);
        assert_eq!(line_at(b"a\r\nb\nc\rd", 5), 3);
        assert_eq!(line_at(b"a\r\nb\nc\rd", 7), 4);
    }
}
