//! Reading a log from CSV text.
//!
//! Accepted silently: a byte order mark, CRLF line ends, spaces around cells, quoted cells and
//! blank lines. Everything else that is not a complete table of finite numbers is an error.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord};

use super::column::unwrap;
use super::columns::{Cell, Columns, Header, Layout};
use super::error::{CellFault, LogError};
use super::local_cubic::slopes;
use super::log::Log;

impl Log {
    /// Reads one trajectory of a rig with `joints` joints from a CSV file.
    ///
    /// Columns may stand in any order. Columns that nothing asks for are ignored, and a note names
    /// them. A file without any torque column is the log of a passive rig: its torques are zero, and
    /// a note says so. Without any velocity column, velocities are the slopes of cubics fitted to the angles.
    ///
    /// # Errors
    /// A [`LogError`] that names file, line, column, fault and remedy, for anything that is not a
    /// table of finite numbers with strictly increasing time and the asked number of joints.
    pub fn read(path: impl AsRef<Path>, joints: usize, columns: &Columns) -> Result<Log, LogError> {
        let path = path.as_ref();
        let text = &text_of(path)?;
        Table { path, text }.log(joints, columns)
    }

    /// Reads a CSV file with the standard columns, of as many joints as its header has.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn read_standard(path: impl AsRef<Path>) -> Result<Log, LogError> {
        let path = path.as_ref();
        let text = &text_of(path)?;
        let table = Table { path, text };
        let joints = table.rows()?.first().map_or(0, Row::joints);
        // A header of no joint lacks the first.
        table.log(joints.max(1), &Columns::default())
    }
}

/// The text of a file, without a byte order mark.
fn text_of(path: &Path) -> Result<String, LogError> {
    let bytes = fs::read(path).map_err(|why| LogError::Open {
        path: path.to_owned(),
        why,
    })?;
    let text = std::str::from_utf8(&bytes).map_err(|error| LogError::NotUtf8 {
        path: path.to_owned(),
        line: line_at(&bytes, error.valid_up_to()),
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text).to_owned())
}

/// The text of a log and its path.
struct Table<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Table<'_> {
    fn log(&self, joints: usize, columns: &Columns) -> Result<Log, LogError> {
        let mut rows = self.rows()?.into_iter();
        let path = self.path.to_owned();
        let Some(first) = rows.next() else {
            return Err(LogError::Empty { path });
        };
        let header = Header {
            path: self.path,
            line: first.line(),
            names: first.names(),
        };
        let layout = header.layout(joints, columns)?;
        let rows: Vec<Row> = rows.collect();
        if rows.len() < 2 {
            let rows = rows.len();
            return Err(LogError::TooFewRows { path, rows });
        }
        rows.iter().try_for_each(|row| row.check_width(&header))?;
        let column = |cell: &Cell| -> Result<Vec<f64>, LogError> {
            let number = |row: &Row| Ok(cell.scale * row.number(&header, cell.index)?);
            rows.iter().map(number).collect()
        };
        let channel = |cells: &[Cell]| cells.iter().map(column).collect::<Result<Vec<_>, _>>();
        let time = column(&layout.time)?;
        check_time(&rows, &time, &header.names[layout.time.index])?;
        let (mut q, mut notes) = (channel(&layout.q)?, notes(&layout));
        for (angles, cell) in q.iter_mut().zip(&layout.q).filter(|(_, cell)| cell.wrapped) {
            let (name, passed) = (&header.names[cell.index], unwrap(angles, TAU));
            notes.push(format!(
                "{name} passes the end of its turn {passed} times: full turns are counted"
            ));
        }
        Ok(Log {
            path,
            qd: match &layout.qd {
                Some(qd) => channel(qd)?,
                None => q.iter().map(|q| slopes(&time, q)).collect(),
            },
            tau: match &layout.tau {
                Some(tau) => channel(tau)?,
                None => vec![vec![0.0; time.len()]; joints],
            },
            driven_by: columns.driven_by,
            masked: vec![vec![]; joints],
            filled: vec![],
            q,
            time,
            leave_out: vec![],
            notes,
        })
    }

    /// All rows that are not blank, the header first.
    fn rows(&self) -> Result<Vec<Row<'_>>, LogError> {
        let mut reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .from_reader(self.text.as_bytes());
        let mut rows = vec![];
        for record in reader.records() {
            let record = record.map_err(|why| LogError::Open {
                path: self.path.to_owned(),
                why: why.into(),
            })?;
            let blank = record.len() == 1 && bare(&record[0]).is_empty();
            if !blank {
                rows.push(Row {
                    table: self,
                    record,
                });
            }
        }
        Ok(rows)
    }
}

/// One row of a table.
struct Row<'a> {
    table: &'a Table<'a>,
    record: StringRecord,
}

impl Row<'_> {
    /// The row's line, counted from 1. Found by counting, as only errors ask for it; the reader's own
    /// count is behind by one after a CRLF or a blank line.
    fn line(&self) -> usize {
        let bytes = self.table.text.as_bytes();
        let after_previous = self
            .record
            .position()
            .map_or(0, |place| place.byte() as usize);
        let line_ends = bytes[after_previous..]
            .iter()
            .take_while(|byte| matches!(byte, b'\r' | b'\n'));
        line_at(bytes, after_previous + line_ends.count())
    }

    /// The cells as column names.
    fn names(&self) -> Vec<String> {
        let cells = self.record.iter();
        cells.map(|cell| bare(cell).to_owned()).collect()
    }

    /// How many joints have an angle, as a header: `q1`, `q2` and so on.
    fn joints(&self) -> usize {
        let names = self.names();
        let has = |joint: &usize| names.contains(&format!("q{joint}"));
        (1..).take_while(has).count()
    }

    fn check_width(&self, header: &Header) -> Result<(), LogError> {
        if self.record.len() == header.names.len() {
            return Ok(());
        }
        Err(LogError::Width {
            path: self.table.path.to_owned(),
            line: self.line(),
            found: self.record.len(),
            expected: header.names.len(),
        })
    }

    fn number(&self, header: &Header, index: usize) -> Result<f64, LogError> {
        number(bare(&self.record[index])).map_err(|fault| self.fault(&header.names[index], fault))
    }

    fn fault(&self, column: &str, fault: CellFault) -> LogError {
        LogError::Cell {
            path: self.table.path.to_owned(),
            line: self.line(),
            column: column.to_owned(),
            fault,
        }
    }
}

fn check_time(rows: &[Row], time: &[f64], column: &str) -> Result<(), LogError> {
    match time.windows(2).position(|pair| pair[1] <= pair[0]) {
        None => Ok(()),
        Some(previous) => Err(rows[previous + 1].fault(
            column,
            CellFault::NotLater {
                time: time[previous + 1],
                previous: time[previous],
                previous_line: rows[previous].line(),
            },
        )),
    }
}

fn notes(layout: &Layout) -> Vec<String> {
    let mut notes = vec![];
    if !layout.ignored.is_empty() {
        let names: Vec<String> = layout
            .ignored
            .iter()
            .map(|name| format!("{name:?}"))
            .collect();
        notes.push(format!("columns ignored: {}", names.join(", ")));
    }
    if layout.qd.is_none() {
        notes.push(
            "velocities come from the angles: slopes of cubics fitted around each row".to_owned(),
        );
    }
    if layout.tau.is_none() {
        notes.push("no torque columns: read as a passive rig, with zero torque".to_owned());
    }
    notes
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
    use super::super::column::Column;
    use super::*;

    fn read(text: &str, joints: usize) -> Result<Log, LogError> {
        let path = Path::new("rig.csv");
        Table { path, text }.log(joints, &Columns::default())
    }

    fn message(text: &str) -> String {
        read(text, 1).unwrap_err().to_string()
    }

    #[test]
    fn spreadsheet_habits_are_accepted() {
        let text = " time , \"q1\",qd1, tau1 ,mode\r\n\r\n0, 1 ,\"2\", \"3\" ,run\r\n0.1,4,5,6,stop\r\n \r\n\r\n";
        let log = read(text, 1).unwrap();
        assert_eq!(log.time, [0.0, 0.1]);
        assert_eq!((&log.q[0], &log.qd[0]), (&vec![1.0, 4.0], &vec![2.0, 5.0]));
        assert_eq!(log.tau[0], [3.0, 6.0]);
        assert_eq!(log.notes, ["columns ignored: \"mode\""]);
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_first_name() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        fs::write(&path, "\u{feff}time,q1,qd1,tau1\n0,1,2,3\n1,1,2,3\n").unwrap();
        assert_eq!(Log::read(&path, 1, &Columns::default()).unwrap().rows(), 2);
    }

    #[test]
    fn a_log_without_torque_is_a_passive_rig_with_a_note() {
        let log = read("time,q1,qd1\n0,1,2\n1,1,2\n", 1).unwrap();
        assert_eq!(log.tau, [[0.0, 0.0]]);
        assert!(log.notes[0].contains("passive"));
    }

    #[test]
    fn a_log_without_velocity_takes_it_from_the_angles_with_a_note() {
        let rows: Vec<String> = (0..50)
            .map(|i| f64::from(i) * 0.01)
            .map(|t| format!("{t},{},0", 3.0 * t * t))
            .collect();
        let log = read(&format!("time,q1,tau1\n{}\n", rows.join("\n")), 1).unwrap();
        let off = |row: usize| (log.qd[0][row] - 6.0 * log.time[row]).abs();
        // At the ends a difference of neighbours is half a step late: 6 rad/s^2 * 5 ms.
        assert!((4..46).all(|row| off(row) < 1e-9) && (0..50).all(|row| off(row) < 0.031));
        assert!(log.notes[0].contains("velocities come from the angles"));
    }

    #[test]
    fn units_factors_and_turns_are_read() {
        let columns = Columns {
            time: Column {
                unit: Some("us"),
                ..Column::named("time")
            },
            q: vec![Column {
                unit: Some("deg"),
                wrapped: true,
                ..Column::named("q1")
            }],
            tau: vec![Column {
                factor: -2.0,
                ..Column::named("tau1")
            }],
            ..Columns::default()
        };
        let (path, text) = (
            Path::new("rig.csv"),
            "time,q1,qd1,tau1\n0,170,1,5\n1e4,-170,1,6\n",
        );
        let log = Table { path, text }.log(1, &columns).unwrap();
        assert!((log.time[1] - 0.01).abs() < 1e-15);
        assert!((log.q[0][1].to_degrees() - 190.0).abs() < 1e-9);
        assert_eq!((log.qd[0][1], log.tau[0][1]), (1.0, -12.0));
    }

    #[test]
    fn a_wrong_cell_is_shown_with_its_place() {
        let head = "time,q1,qd1,tau1\r\n0,0,0,0\r\n\r\n";
        assert_eq!(
            message(&format!("{head}1,abc,0,0\r\n")),
            "rig.csv, line 4, column \"q1\": \"abc\" is not a number; write a decimal number such as 0.25"
        );
        assert!(message(&format!("{head}1,0,,0\r\n")).contains("line 4, column \"qd1\": is empty"));
        let finite = message(&format!("{head}1,0,0,-inf\r\n"));
        assert!(
            finite.contains("column \"tau1\": \"-inf\" is not a finite"),
            "{finite}"
        );
        let width = message(&format!("{head}1,0,0\r\n"));
        assert!(
            width.contains("line 4: has 3 cell(s) where the header has 4"),
            "{width}"
        );
    }

    #[test]
    fn time_has_to_increase() {
        let error = message("time,q1,qd1,tau1\n0.5,0,0,0\n0.5,0,0,0\n");
        assert!(
            error.starts_with(
                "rig.csv, line 3, column \"time\": time 0.5 s does not come after 0.5 s of line 2"
            ),
            "{error}"
        );
    }

    #[test]
    fn files_without_a_trajectory_say_so() {
        assert!(message("").contains("rig.csv: is empty"));
        assert!(message("\n \n").contains("is empty"));
        assert!(message("time,q1,qd1,tau1\n").contains("has 0 row(s)"));
        assert!(message("time,q1,qd1,tau1\n0,0,0,0\n").contains("has 1 row(s)"));
        let missing = Log::read("/no/such/rig.csv", 1, &Columns::default()).unwrap_err();
        assert!(missing.to_string().contains("cannot be read"), "{missing}");
    }

    #[test]
    fn bytes_that_are_not_text_are_placed() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        fs::write(&path, b"time,q1,qd1,tau1\n0,0,0,\xff\n").unwrap();
        let error = Log::read(&path, 1, &Columns::default()).unwrap_err();
        assert!(error.to_string().contains("line 2: not UTF-8"), "{error}");
    }

    #[test]
    fn lines_are_counted_as_an_editor_does() {
        assert_eq!(line_at(b"a\r\nb\nc\rd", 0), 1);
        assert_eq!(line_at(b"a\r\nb\nc\rd", 3), 2);
        assert_eq!(line_at(b"a\r\nb\nc\rd", 5), 3);
        assert_eq!(line_at(b"a\r\nb\nc\rd", 7), 4);
    }
}
