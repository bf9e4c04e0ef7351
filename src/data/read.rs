//! Reading a log from the table that a file holds.

use std::f64::consts::TAU;
use std::path::Path;

use super::column::{Quantity, unwrap};
use super::columns::{Cell, Columns, Header, Layout, joints};
use super::error::{CellFault, LogError};
use super::late;
use super::local_cubic::slopes;
use super::log::Log;
use super::statistics::median;
use super::table::{Arrays, Table, open, too_large};
use crate::expr::listed;
use crate::limits::{LOG_JOINTS, LOG_TIME, is_reading, log_steps};

impl Log {
    /// Reads one trajectory of a rig with `joints` joints from a file, or a folder, of any format that is read.
    ///
    /// Columns may stand in any order. Columns that nothing asks for are ignored, and a note names
    /// them. A file without any torque column is the log of a passive rig: its torques are zero, and
    /// a note says so. Without any velocity column, velocities are the slopes of cubics fitted to the angles.
    ///
    /// # Errors
    /// A [`LogError`] that names file, place, column, fault and remedy, for anything that is not a
    /// table of finite numbers with strictly increasing time and the asked number of joints.
    pub fn read(path: impl AsRef<Path>, joints: usize, columns: &Columns) -> Result<Log, LogError> {
        let path = path.as_ref();
        let columns = columns.completed(joints, path)?;
        log(path, open(path, &columns)?.as_mut(), joints, &columns)
    }

    /// Reads a file with the standard columns, of as many joints as its header has, in its order where they have names.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn read_standard(path: impl AsRef<Path>) -> Result<Log, LogError> {
        let path = path.as_ref();
        let mut table = open(path, &Columns::default())?;
        standard(path, table.as_mut(), Quantity::Torque)
    }

    /// The log that a file with these columns, in memory, is: with `rig` as [`Log::read`] by its columns and number of
    /// joints, else as [`Log::read_standard`], where columns `cmd1`, ... without torques are commands. `name` is for messages
    /// and for the report.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn from_columns(
        name: &str,
        columns: impl IntoIterator<Item = (String, Vec<f64>)>,
        rig: Option<(usize, &Columns)>,
    ) -> Result<Log, LogError> {
        let path = Path::new(name);
        // What is in memory already needs no limit.
        let mut table = Arrays::of(u64::MAX);
        for (name, column) in columns {
            table.add(name, column);
        }
        match rig {
            Some((joints, columns)) => {
                log(path, &mut table, joints, &columns.completed(joints, path)?)
            }
            None => {
                let has = |name: &str| table.names().iter().any(|known| known == name);
                let driven_by = match has("cmd1") && !has("tau1") {
                    true => Quantity::Command,
                    false => Quantity::Torque,
                };
                standard(path, &mut table, driven_by)
            }
        }
    }
}

/// The log of a table with the standard columns.
fn standard(path: &Path, table: &mut dyn Table, driven_by: Quantity) -> Result<Log, LogError> {
    let has = |joint: &usize| table.names().contains(&format!("q{joint}"));
    let numbered = (1..).take_while(has).count();
    check_joints(path, numbered.max(joints(table.names()).len()))?;
    let named = joints(table.names()).into_iter();
    let columns = Columns {
        joint_names: named.map(str::to_owned).collect(),
        driven_by,
        ..Columns::default()
    };
    // A header of no joint lacks the first.
    let count = numbered.max(columns.joint_names.len()).max(1);
    log(path, table, count, &columns)
}

/// Refuses more joints than are looked at without a model that chooses among them.
fn check_joints(path: &Path, joints: usize) -> Result<(), LogError> {
    match joints <= LOG_JOINTS {
        true => Ok(()),
        false => Err(LogError::Form {
            path: path.to_owned(),
            fault: format!(
                "has {joints} joints; at most {LOG_JOINTS} are read: give a model that names its own under [columns]"
            ),
        }),
    }
}

/// The log that the table of a file is.
pub(super) fn log(
    path: &Path,
    table: &mut dyn Table,
    joints: usize,
    columns: &Columns,
) -> Result<Log, LogError> {
    let header = Header {
        path,
        place: table.head(),
        names: table.names().to_vec(),
    };
    let layout = header.layout(joints, columns)?;
    let path = path.to_owned();
    let wanted: Vec<usize> = layout.cells().map(|cell| cell.index).collect();
    let numbers = table.numbers(&wanted)?;
    if numbers.rows < 2 {
        let rows = numbers.rows;
        return Err(LogError::TooFewRows { path, rows });
    }
    if let Some((row, found)) = numbers.ragged {
        return Err(LogError::Width {
            path,
            place: table.place(row)?,
            found,
            expected: header.names.len(),
        });
    }
    // What a log of many joints lacks is made: a short text may become many numbers.
    let bytes = (8 * (1 + 3 * joints) as u64).saturating_mul(numbers.rows as u64);
    if bytes > table.most_bytes() {
        let fault = too_large().to_string();
        return Err(LogError::Form { path, fault });
    }
    let table: &dyn Table = table;
    let fault = |row: usize, column: usize, fault: CellFault| match table.place(row) {
        Ok(place) => LogError::Cell {
            path: path.clone(),
            place,
            column: header.names[column].clone(),
            fault,
        },
        Err(unreadable) => unreadable,
    };
    // The cells are gone through in the order in which they were asked for.
    let mut numbers = numbers.columns.into_iter();
    let mut column = |cell: &Cell| -> Result<Vec<f64>, LogError> {
        let mut read = numbers.next().unwrap_or_default();
        for (row, value) in read.values.iter_mut().enumerate() {
            let reading = cell.scale * *value;
            if !is_reading(reading) {
                return Err(fault(row, cell.index, CellFault::TooLarge(*value)));
            }
            *value = reading;
        }
        match read.fault {
            Some(why) => Err(fault(read.values.len(), cell.index, why)),
            None => Ok(read.values),
        }
    };
    let time = column(&layout.time)?;
    if let Some(previous) = time.windows(2).position(|pair| pair[1] <= pair[0]) {
        let late = CellFault::NotLater {
            time: time[previous + 1],
            previous: time[previous],
            previous_place: table.place(previous)?,
        };
        return Err(fault(previous + 1, layout.time.index, late));
    }
    if let Some(row) = time.iter().position(|time| time.abs() > LOG_TIME) {
        return Err(fault(row, layout.time.index, CellFault::TooLate(time[row])));
    }
    if let Some(pause) = longest_pause(&time) {
        let long = CellFault::Pause {
            pause_s: pause.length_s,
            step_s: pause.step_s,
            previous_place: table.place(pause.row - 1)?,
        };
        return Err(fault(pause.row, layout.time.index, long));
    }
    let mut notes = [table.notes().to_vec(), notes(&layout)].concat();
    let mut values = |cell: &Cell| -> Result<Vec<f64>, LogError> {
        let mut values = column(cell)?;
        if cell.wrapped {
            let (name, passed) = (&header.names[cell.index], unwrap(&mut values, TAU));
            notes.push(format!(
                "{name} passes the end of its turn {passed} times: full turns are counted"
            ));
        }
        Ok(late::undone(&time, values, cell.late_s))
    };
    let mut channel = |cells: &[Cell]| cells.iter().map(&mut values).collect::<Result<Vec<_>, _>>();
    let q = channel(&layout.q)?;
    let qd = layout.qd.as_deref().map(&mut channel).transpose()?;
    let tau = layout.tau.as_deref().map(&mut channel).transpose()?;
    let log = Log {
        qd: qd.unwrap_or_else(|| q.iter().map(|q| slopes(&time, q)).collect()),
        tau: tau.unwrap_or_else(|| vec![vec![0.0; time.len()]; joints]),
        driven_by: columns.driven_by,
        masked: vec![vec![]; joints],
        filled: vec![],
        q,
        time,
        leave_out: vec![],
        notes,
        path,
    };
    let log = late::cut(log, layout.late_s());
    match log.rows() {
        rows @ (0 | 1) => Err(LogError::TooFewRows {
            path: log.path,
            rows,
        }),
        _ => Ok(log),
    }
}

/// A pause in a log, before a row of it.
struct Pause {
    row: usize,
    length_s: f64,
    /// The median step of the log \[s\].
    step_s: f64,
}

/// The longest pause of a log that lasts for more of its median steps than are taken.
fn longest_pause(time: &[f64]) -> Option<Pause> {
    let duration_s = time.last()? - time.first()?;
    let most = log_steps(time.len());
    let steps = || time.windows(2).map(|pair| pair[1] - pair[0]);
    // Most logs need no median.
    if duration_s <= most * steps().fold(f64::INFINITY, f64::min) {
        return None;
    }
    let step_s = median(&steps().collect::<Vec<_>>());
    let (longest, length_s) = steps().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (duration_s > most * step_s).then_some(Pause {
        row: longest + 1,
        length_s,
        step_s,
    })
}

fn notes(layout: &Layout) -> Vec<String> {
    let mut notes = vec![];
    if !layout.ignored.is_empty() {
        let names: Vec<String> = layout
            .ignored
            .iter()
            .map(|name| format!("{name:?}"))
            .collect();
        let names = listed(names.iter().map(String::as_str));
        notes.push(format!("columns ignored: {names}"));
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::column::Column;
    use super::super::table::{Csv, Source};
    use super::*;

    fn read(text: &str, joints: usize) -> Result<Log, LogError> {
        read_as(text, joints, &Columns::default())
    }

    fn read_as(text: &str, joints: usize, columns: &Columns) -> Result<Log, LogError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(&file, text).unwrap();
        let path = Path::new("rig.csv");
        let mut table = Csv::of(path, Source::of(file.path())?)?;
        log(path, &mut table, joints, columns)
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
        let text = "time,q1,qd1,tau1\n0,170,1,5\n1e4,-170,1,6\n";
        let log = read_as(text, 1, &columns).unwrap();
        assert!((log.time[1] - 0.01).abs() < 1e-15);
        assert!((log.q[0][1].to_degrees() - 190.0).abs() < 1e-9);
        assert_eq!((log.qd[0][1], log.tau[0][1]), (1.0, -12.0));
    }

    #[test]
    fn a_late_column_is_moved_and_rows_without_a_value_are_dropped() {
        let columns = Columns {
            tau: vec![Column {
                late_s: 0.5,
                ..Column::named("tau1")
            }],
            ..Columns::default()
        };
        let text = "time,q1,qd1,tau1\n0,1,0,0\n1,2,0,10\n2,3,0,20\n3,4,0,30\n";
        let log = read_as(text, 1, &columns).unwrap();
        assert_eq!(log.time, [0.0, 1.0, 2.0]);
        assert_eq!(
            (&log.q[0], &log.tau[0]),
            (&vec![1.0, 2.0, 3.0], &vec![5.0, 15.0, 25.0])
        );
        let columns = Columns {
            tau: vec![Column {
                late_s: 2.5,
                ..Column::named("tau1")
            }],
            ..columns
        };
        let few = read_as(text, 1, &columns).unwrap_err().to_string();
        assert!(few.contains("has 1 row(s)"), "{few}");
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
    fn other_separators_and_decimal_commas_are_found() {
        for text in [
            "time;q1;qd1;tau1\n0;1,5;2;3\n0,1;4;5;6\n",
            "time\tq1\tqd1\ttau1\n0\t1,5\t2\t3\n0,1\t4\t5\t6\n",
            "time|q1|qd1|tau1\n0|1.5|2|3\n0.1|4|5|6\n",
        ] {
            let log = read(text, 1).unwrap();
            assert_eq!((log.time[1], log.q[0][0]), (0.1, 1.5), "{text}");
        }
        let both = message("time;q1;qd1;tau1\n0;1.234,5;2;3\n1;1;1;1\n");
        assert!(both.contains("\"1.234,5\" is not a number"), "{both}");
    }
}
