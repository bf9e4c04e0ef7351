//! Text tables: CSV and its relatives.
//!
//! Accepted silently: a byte order mark, CRLF line ends, spaces around cells, quoted cells and blank lines. Columns are
//! separated by the character that separates the first row's cells, or by spaces; decimal commas are read unless the
//! separator is a comma. Without a header, the columns' names are their numbers, from 1.
//!
//! A text is read row by row and may be larger than the memory: only the numbers of the columns asked for are kept.

use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Read};
use std::path::{Path, PathBuf};

use csv::{Reader, ReaderBuilder, StringRecord};

use super::budget::too_large;
use super::source::{BLOCK, Source};
use residyn_core::data::{CellFault, LogError, Place};
use residyn_core::data::{Numbers, Table};
use residyn_core::limits::{TEXT_BYTES, unpacked_bytes};

/// A text divided into cells.
pub struct Csv {
    /// As its user calls it.
    path: PathBuf,
    source: Source,
    separator: u8,
    head: Place,
    names: Vec<String>,
    /// Whether the names are those of the first row, and not numbers.
    has_header: bool,
}

/// Possible column separators, the most usual first.
const SEPARATORS: [u8; 4] = *b",;\t|";

const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

impl Csv {
    /// # Errors
    /// A text without a row, or whose header is not UTF-8.
    pub fn of(path: &Path, source: Source) -> Result<Self, LogError> {
        let mut csv = Self {
            path: path.to_owned(),
            source,
            separator: b',',
            head: Place::Line(1),
            names: vec![],
            has_header: true,
        };
        csv.separator = separator(csv.text()?).map_err(|why| csv.unreadable(why))?;
        (csv.head, csv.names) = csv.header()?;
        csv.has_header = !csv.is_data(&csv.names);
        if !csv.has_header {
            csv.names = (1..=csv.names.len()).map(|n| n.to_string()).collect();
        }
        Ok(csv)
    }

    /// Where the first row is, and its cells.
    fn header(&self) -> Result<(Place, Vec<String>), LogError> {
        let mut rows = self.rows()?;
        let Some(header) = rows.next()? else {
            let path = self.path.clone();
            return Err(LogError::Empty { path });
        };
        let names = header.iter().map(|cell| bare(cell).to_owned()).collect();
        Ok((self.line_from(offset(header))?, names))
    }

    /// Whether a first row holds numbers already. Some may be missing; then what is missing is said.
    fn is_data(&self, row: &[String]) -> bool {
        let is_number = |cell: &&String| self.number(cell).is_ok() || cell.parse::<f64>().is_ok();
        let mut filled = row.iter().filter(|cell| !cell.is_empty()).peekable();
        filled.peek().is_some() && filled.all(|cell| is_number(&cell))
    }

    /// The text from its beginning, without a byte order mark.
    fn text(&self) -> Result<impl Read + use<>, LogError> {
        let text = || -> io::Result<_> {
            let mut text = self.source.open()?;
            let mut first = Vec::new();
            text.by_ref().take(3).read_to_end(&mut first)?;
            if first == BYTE_ORDER_MARK {
                first.clear();
            }
            Ok(Cursor::new(first).chain(text))
        };
        text().map_err(|why| self.unreadable(why))
    }

    /// The rows from the header on.
    fn rows(&self) -> Result<Rows<'_, impl Read + use<>>, LogError> {
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.separator)
            .buffer_capacity(BLOCK)
            .from_reader(self.text()?);
        Ok(Rows {
            csv: self,
            reader,
            row: StringRecord::new(),
        })
    }

    /// The rows below the header, if there is one.
    fn data(&self) -> Result<Rows<'_, impl Read + use<>>, LogError> {
        let mut rows = self.rows()?;
        if self.has_header {
            rows.next()?;
        }
        Ok(rows)
    }

    /// The number in a cell.
    fn number(&self, cell: &str) -> Result<f64, CellFault> {
        // A cell that parses as it stands has no spaces, quotes or commas.
        if let Some(value) = cell.parse().ok().filter(|value: &f64| value.is_finite()) {
            return Ok(value);
        }
        let cell = bare(cell);
        let has_comma = self.separator != b',' && cell.contains(',') && !cell.contains('.');
        match has_comma {
            true => number(&cell.replacen(',', ".", 1)),
            false => number(cell),
        }
    }

    /// The line of the first cell at an offset or after line ends there. Found by counting, since only errors need it;
    /// the reader's own count is behind by one after a CRLF or a blank line.
    fn line_from(&self, offset: u64) -> Result<Place, LogError> {
        let mut lines = Lines::default();
        for (at, byte) in (0..).zip(BufReader::with_capacity(BLOCK, self.text()?).bytes()) {
            let byte = byte.map_err(|why| self.unreadable(why))?;
            if at >= offset && !matches!(byte, b'\r' | b'\n') {
                break;
            }
            lines.pass(&[byte]);
        }
        Ok(Place::Line(lines.number()))
    }

    fn fault(&self, fault: csv::Error) -> LogError {
        match fault.into_kind() {
            csv::ErrorKind::Io(why) => self.unreadable(why),
            csv::ErrorKind::Utf8 { .. } => match self.line_of_no_text() {
                Ok(line) => LogError::NotUtf8 {
                    path: self.path.clone(),
                    line,
                },
                Err(fault) => fault,
            },
            other => self.unreadable(io::Error::new(ErrorKind::InvalidData, format!("{other:?}"))),
        }
    }

    /// The line of the first byte that is not UTF-8.
    fn line_of_no_text(&self) -> Result<usize, LogError> {
        let mut text = BufReader::with_capacity(BLOCK, self.text()?);
        let (mut lines, mut unread) = (Lines::default(), Vec::new());
        loop {
            let block = text.fill_buf().map_err(|why| self.unreadable(why))?;
            let read = block.len();
            unread.extend_from_slice(block);
            text.consume(read);
            let (valid, is_cut) = match std::str::from_utf8(&unread) {
                Ok(_) => (unread.len(), read > 0),
                // A character may continue in the next block.
                Err(error) => (error.valid_up_to(), read > 0 && error.error_len().is_none()),
            };
            lines.pass(&unread[..valid]);
            if !is_cut {
                return Ok(lines.number());
            }
            unread.drain(..valid);
        }
    }

    fn unreadable(&self, why: io::Error) -> LogError {
        self.source.fault(&self.path, why)
    }
}

impl Table for Csv {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn head(&self) -> Place {
        self.head
    }

    fn most_bytes(&self) -> u64 {
        match self.source.is_packed() {
            true => unpacked_bytes(self.source.size()),
            false => u64::MAX,
        }
    }

    fn numbers(&mut self, wanted: &[usize]) -> Result<Numbers, LogError> {
        // A column takes up to twice its bytes while it grows.
        let most_rows = self.most_bytes() / (16 * wanted.len() as u64).max(1);
        let mut rows = self.data()?;
        let mut numbers = Numbers::of(wanted.len());
        while let Some(row) = rows.next()? {
            if numbers.rows as u64 == most_rows {
                return Err(self.unreadable(too_large()));
            }
            if row.len() != self.names.len() {
                numbers.ragged.get_or_insert((numbers.rows, row.len()));
            }
            if numbers.ragged.is_none() {
                for (index, column) in wanted.iter().zip(&mut numbers.columns) {
                    column.push(|| self.number(&row[*index]));
                }
            }
            numbers.rows += 1;
        }
        Ok(numbers)
    }

    fn place(&self, row: usize) -> Result<Place, LogError> {
        let mut rows = self.data()?;
        for _ in 0..row {
            rows.next()?;
        }
        let row = rows.next()?;
        self.line_from(row.map_or(0, offset))
    }
}

/// The rows of a text, one at a time.
struct Rows<'c, R> {
    csv: &'c Csv,
    reader: Reader<R>,
    row: StringRecord,
}

impl<R: Read> Rows<'_, R> {
    /// The next row that is not blank.
    fn next(&mut self) -> Result<Option<&StringRecord>, LogError> {
        loop {
            let read = self.reader.read_record(&mut self.row);
            if !read.map_err(|why| self.csv.fault(why))? {
                return Ok(None);
            }
            if self.csv.separator == b' ' {
                self.drop_empty();
            }
            let is_blank =
                self.row.is_empty() || self.row.len() == 1 && bare(&self.row[0]).is_empty();
            if !is_blank {
                return Ok(Some(&self.row));
            }
        }
    }
}

impl<R> Rows<'_, R> {
    /// Any number of spaces separates two cells.
    fn drop_empty(&mut self) {
        let position = self.row.position().cloned();
        let cells = self.row.iter().filter(|cell| !cell.is_empty());
        let mut row: StringRecord = cells.collect();
        row.set_position(position);
        self.row = row;
    }
}

/// The column separator of a text: the one most frequent in its first line, spaces if there is no other and more than
/// one number.
fn separator(text: impl Read) -> io::Result<u8> {
    let mut text = BufReader::new(text.take(TEXT_BYTES));
    let mut first = Vec::new();
    while text.read_until(b'\n', &mut first)? > 0 && is_blank(&first) {
        first.clear();
    }
    let count = |separator: u8| first.iter().filter(|byte| **byte == separator).count();
    // In a tie the last one wins: a comma if nothing separates.
    let all = SEPARATORS.into_iter().rev();
    let most = all.max_by_key(|separator| count(*separator));
    let most = most.filter(|separator| count(*separator) > 0);
    Ok(most.unwrap_or(if is_spaced(&first) { b' ' } else { b',' }))
}

/// Whether spaces separate cells: a line of one name may have some within it.
fn is_spaced(line: &[u8]) -> bool {
    std::str::from_utf8(line).is_ok_and(|line| {
        let mut cells = line.split_whitespace();
        let numbers = cells.clone().all(|cell| cell.parse::<f64>().is_ok());
        cells.clone().count() > 1 && (numbers || cells.any(|cell| cell == "time"))
    })
}

fn is_blank(line: &[u8]) -> bool {
    std::str::from_utf8(line).is_ok_and(|line| line.trim().is_empty())
}

/// Where the row before it ends.
fn offset(row: &StringRecord) -> u64 {
    row.position().map_or(0, csv::Position::byte)
}

/// A cell without the spaces around it, and without quotes after such spaces, which CSV itself does not treat as
/// quotes.
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

/// Counts lines as an editor does: LF, CRLF and a lone CR each end one.
#[derive(Default)]
struct Lines {
    ended: usize,
    is_after_cr: bool,
}

impl Lines {
    fn pass(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let ends = *byte == b'\r' || (*byte == b'\n' && !self.is_after_cr);
            self.ended += usize::from(ends);
            self.is_after_cr = *byte == b'\r';
        }
    }

    /// The line of the next byte, from 1.
    fn number(&self) -> usize {
        self.ended + 1
    }
}

#[cfg(test)]
mod tests {
    use super::Lines;

    #[test]
    fn lines_are_counted_as_an_editor_does() {
        let line = |before: &[u8]| {
            let mut lines = Lines::default();
            lines.pass(before);
            lines.number()
        };
        assert_eq!(line(b""), 1);
        assert_eq!(line(b"a\r\n"), 2);
        assert_eq!(line(b"a\r\nb\n"), 3);
        assert_eq!(line(b"a\r\nb\nc\r"), 4);
    }
}
