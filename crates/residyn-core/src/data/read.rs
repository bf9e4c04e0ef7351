//! Reads a log from the table in a file.

use std::f64::consts::TAU;
use std::path::Path;

use super::column::{Quantity, unwrap};
use super::columns::{Cell, Columns, Header, Layout, joints};
use super::error::{CellFault, LogError};
use super::late;
use super::local_cubic::slopes;
use super::log::Log;
use super::statistics::median;
use super::table::{Arrays, Table};
use crate::expr::listed;
use crate::limits::{LOG_JOINTS, LOG_TIME, is_reading, log_steps, too_large};

impl Log {
    /// One trajectory of a rig with `joints` joints from a file's table; `path` is for messages.
    ///
    /// Columns may be in any order. Columns that are not needed are ignored, and a note names them. A table without any
    /// torque column is the log of a passive rig: its torques are zero, and a note says so. Without any velocity
    /// column, velocities are the slopes of cubics fitted to the angles.
    ///
    /// # Errors
    /// A [`LogError`] that names file, place, column, fault and remedy, for anything that is not a table of finite
    /// numbers with strictly increasing time and the requested number of joints.
    pub fn of_table(
        path: &Path,
        table: &mut dyn Table,
        joints: usize,
        columns: &Columns,
    ) -> Result<Log, LogError> {
        log(path, table, joints, columns)
    }

    /// As [`Log::of_table`], for a table with the standard columns and as many joints as its header has, in its order
    /// if they have names.
    ///
    /// # Errors
    /// As [`Log::of_table`].
    pub fn of_standard_table(path: &Path, table: &mut dyn Table) -> Result<Log, LogError> {
        standard(path, table, Quantity::Torque)
    }

    /// The log with these columns in memory: with `rig`, as [`Log::of_table`] with its columns and number of joints,
    /// otherwise as [`Log::of_standard_table`], where columns `cmd1`, ... without torques are commands. `name` is for
    /// messages and the report.
    ///
    /// # Errors
    /// As [`Log::of_table`].
    pub fn from_columns(
        name: &str,
        columns: impl IntoIterator<Item = (String, Vec<f64>)>,
        rig: Option<(usize, &Columns)>,
    ) -> Result<Log, LogError> {
        let path = Path::new(name);
        // Data already in memory need no limit.
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
    // A header without joints lacks the first.
    let count = numbered.max(columns.joint_names.len()).max(1);
    log(path, table, count, &columns)
}

/// Refuses more joints than are read without a model that chooses among them.
fn check_joints(path: &Path, joints: usize) -> Result<(), LogError> {
    match joints <= LOG_JOINTS {
        true => Ok(()),
        false => Err(LogError::Form {
            path: path.to_owned(),
            fault: format!(
                "has {joints} joints; at most {LOG_JOINTS} are read: give a model that names its columns under \
                 [columns]"
            ),
        }),
    }
}

/// The log in a file's table.
fn log(
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
    // Channels that a log of many joints lacks are generated: a short text may become many numbers.
    let bytes = (8 * (1 + 3 * joints) as u64).saturating_mul(numbers.rows as u64);
    if bytes > table.most_bytes() {
        let fault = too_large();
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
    // The cells are read in the order in which they were requested.
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
                "{name} wraps {passed} times: full turns are counted"
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

/// A pause in a log, before one of its rows.
struct Pause {
    row: usize,
    length_s: f64,
    /// The median step of the log \[s\].
    step_s: f64,
}

/// The longest pause of a log, if the log lasts for more of its median steps than are accepted.
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
