//! Reads a log from the table in a file.

use std::f64::consts::TAU;
use std::path::Path;

use super::clocks::Merged;
use super::column::{Quantity, unwrap};
use super::columns::{Cell, Columns, Header, Layout, MeasuredCell, joints};
use super::error::{CellFault, LogError, Place};
use super::joint::Joint;
use super::late;
use super::local_cubic::slopes;
use super::log::Log;
use super::measured::Measured;
use super::statistics::median;
use super::table::{Arrays, Numeric, Table};
use super::torque_column::TorqueColumn;
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
        let header = Header {
            path,
            place: table.head(),
            names: table.names().to_vec(),
        };
        let layout = header.layout(joints, columns)?;
        let numbers = numbers(&header, table, &layout, joints)?;
        let merged = merged(&numbers, &layout, columns);
        let on_one_clock = |column: Numeric| match &merged {
            Some(merged) => merged.column(column),
            None => column.without_gaps(),
        };
        let numbers: Vec<Numeric> = numbers.into_iter().map(on_one_clock).collect();
        let (rows, note) = merged.map(|merged| (merged.rows, merged.note)).unzip();
        let mut readings = Readings {
            header: &header,
            table,
            numbers: numbers.into_iter(),
            rows,
            notes: [table.notes().to_vec(), notes(&layout, columns.driven_by)].concat(),
        };
        readings.notes.extend(note);
        let time = readings.time(&layout.time)?;
        let mut channel = |cells: &[Cell]| -> Result<Vec<Vec<f64>>, LogError> {
            let each = cells.iter().map(|cell| readings.channel(cell, &time));
            each.collect()
        };
        let q = channel(&layout.q)?;
        let qd = layout.qd.as_deref().map(&mut channel).transpose()?;
        let mut driven = |cell: &Option<Cell>| match cell {
            Some(cell) => readings.channel(cell, &time),
            None => Ok(vec![0.0; time.len()]),
        };
        let tau = layout.tau.as_ref();
        let tau = tau.map(|cells| cells.iter().map(&mut driven).collect::<Result<_, _>>());
        let tau = tau.transpose()?;
        let measured = readings.measured(&layout.measured, &time)?;
        let log = Log {
            is_qd_derived: qd.is_none(),
            qd: qd.unwrap_or_else(|| q.iter().map(|q| slopes(&time, q)).collect()),
            tau: tau.unwrap_or_else(|| vec![vec![0.0; time.len()]; joints]),
            driven_by: columns.driven_by,
            measured,
            values: readings.table.values().to_vec(),
            notes: readings.notes,
            q,
            time,
            path: path.to_owned(),
            ..Log::empty(joints)
        };
        let log = late::cut(log, layout.late_s());
        match log.rows() {
            rows @ (0 | 1) => Err(LogError::TooFewRows {
                path: log.path,
                rows,
            }),
            _ => Ok(log.with_torques(columns.torque.unwrap_or_default())),
        }
    }

    /// As [`Log::of_table`], for a table with the standard columns and as many joints as its header has, in its order
    /// if they have names. Columns `cmd1`, ... without torques are commands.
    ///
    /// # Errors
    /// As [`Log::of_table`].
    pub fn of_standard_table(path: &Path, table: &mut dyn Table) -> Result<Log, LogError> {
        standard(path, table)
    }

    /// The log with these columns in memory: with `rig`, as [`Log::of_table`] with its columns and number of joints,
    /// otherwise as [`Log::of_standard_table`]. `name` is for messages and the report.
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
            Some((joints, columns)) => Log::of_table(path, &mut table, joints, columns),
            None => standard(path, &mut table),
        }
    }
}

/// The log of a table with the standard columns.
fn standard(path: &Path, table: &mut dyn Table) -> Result<Log, LogError> {
    let has = |joint: &usize| table.names().contains(&format!("q{joint}"));
    let numbered = (1..).take_while(has).count();
    check_joints(path, numbered.max(joints(table.names()).len()))?;
    let named = joints(table.names()).into_iter();
    let columns = Columns {
        joint_names: named.map(str::to_owned).collect(),
        driven_by: driven_by(table.names()),
        ..Columns::default()
    };
    // A header without joints lacks the first.
    let count = numbered.max(columns.joint_names.len()).max(1);
    Log::of_table(path, table, count, &columns)
}

/// What the standard columns of a header drive: commands if it has any, and no torque.
fn driven_by(header: &[String]) -> Quantity {
    let has = |quantity: Quantity| {
        let [first, named] = ["1", "_"].map(|end| format!("{}{end}", quantity.key()));
        let is_one = |name: &String| *name == first || name.starts_with(&named);
        header.iter().any(is_one)
    };
    match has(Quantity::Command) && !has(Quantity::Torque) {
        true => Quantity::Command,
        false => Quantity::Torque,
    }
}

/// Refuses more joints than are read without a model that chooses among them.
fn check_joints(path: &Path, joints: usize) -> Result<(), LogError> {
    match joints <= LOG_JOINTS {
        true => Ok(()),
        false => Err(LogError::form(
            path,
            format!(
                "has {joints} joints; at most {LOG_JOINTS} are read: give a model that names its columns under \
                 [columns]"
            ),
        )),
    }
}

/// The columns of a layout's cells, in their order.
fn numbers(
    header: &Header<'_>,
    table: &mut dyn Table,
    layout: &Layout,
    joints: usize,
) -> Result<Vec<Numeric>, LogError> {
    let path = header.path.to_owned();
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
        return Err(LogError::form(&path, too_large()));
    }
    Ok(numbers.columns)
}

/// The rows of a table that has commands on another clock than angles. Readings of a sensor and means hold for no time.
fn merged(numbers: &[Numeric], layout: &Layout, columns: &Columns) -> Option<Merged> {
    if columns.torque.unwrap_or_default() != TorqueColumn::Held {
        return None;
    }
    let (time, channels) = numbers.split_first()?;
    let states = layout.q.len() + layout.qd.as_ref().map_or(0, Vec::len);
    let (states, held) = channels.split_at(states);
    Merged::of(time, states, held, columns.driven_by)
}

/// The columns of a table as they become the channels of a log.
struct Readings<'t> {
    header: &'t Header<'t>,
    table: &'t dyn Table,
    /// Those of the layout's cells, in their order, as far as they are not read yet.
    numbers: std::vec::IntoIter<Numeric>,
    /// Their rows in the table, if these are not all.
    rows: Option<Vec<usize>>,
    notes: Vec<String>,
}

impl Readings<'_> {
    /// Where a row of the numbers is.
    fn place(&self, row: usize) -> Result<Place, LogError> {
        self.table
            .place(self.rows.as_ref().map_or(row, |rows| rows[row]))
    }

    fn fault(&self, row: usize, cell: &Cell, fault: CellFault) -> LogError {
        self.fault_at(self.place(row), cell, fault)
    }

    fn fault_at(&self, place: Result<Place, LogError>, cell: &Cell, fault: CellFault) -> LogError {
        match place {
            Ok(place) => LogError::Cell {
                path: self.header.path.to_owned(),
                place,
                column: self.header.names[cell.index].clone(),
                fault,
            },
            Err(unreadable) => unreadable,
        }
    }

    /// The next column, which is that of this cell, in its unit.
    fn scaled(&mut self, cell: &Cell) -> Result<Vec<f64>, LogError> {
        let mut read = self.numbers.next().unwrap_or_default();
        for (row, value) in read.values.iter_mut().enumerate() {
            let reading = cell.scale * *value;
            if !is_reading(reading) {
                return Err(self.fault(row, cell, CellFault::TooLarge(*value)));
            }
            *value = reading;
        }
        match read.fault {
            Some((row, why)) => Err(self.fault_at(self.table.place(row), cell, why)),
            None => Ok(read.values),
        }
    }

    /// The column of times, which increase without a long pause.
    fn time(&mut self, cell: &Cell) -> Result<Vec<f64>, LogError> {
        let time = self.scaled(cell)?;
        if let Some(previous) = time.windows(2).position(|pair| pair[1] <= pair[0]) {
            let late = CellFault::NotLater {
                time: time[previous + 1],
                previous: time[previous],
                previous_place: self.place(previous)?,
            };
            return Err(self.fault(previous + 1, cell, late));
        }
        if let Some(row) = time.iter().position(|time| time.abs() > LOG_TIME) {
            return Err(self.fault(row, cell, CellFault::TooLate(time[row])));
        }
        if let Some(pause) = longest_pause(&time) {
            let long = CellFault::Pause {
                pause_s: pause.length_s,
                step_s: pause.step_s,
                previous_place: self.place(pause.row - 1)?,
            };
            return Err(self.fault(pause.row, cell, long));
        }
        Ok(time)
    }

    /// The further measured columns. Those that the model does not need are left out if they are not numbers.
    fn measured(
        &mut self,
        cells: &[MeasuredCell],
        time: &[f64],
    ) -> Result<Vec<Measured>, LogError> {
        let mut measured = Vec::new();
        for MeasuredCell {
            name,
            cell,
            is_needed,
        } in cells
        {
            match self.channel(cell, time) {
                Ok(values) => measured.push(Measured {
                    name: name.clone(),
                    values,
                }),
                Err(fault) if *is_needed => return Err(fault),
                Err(fault) => (self.notes).push(format!("column {name:?} is ignored: {fault}")),
            }
        }
        Ok(measured)
    }

    /// The column of an angle, a velocity, a torque or a further measured quantity, at these times.
    fn channel(&mut self, cell: &Cell, time: &[f64]) -> Result<Vec<f64>, LogError> {
        let mut values = self.scaled(cell)?;
        if cell.wrapped {
            let passed = unwrap(&mut values, TAU);
            let name = &self.header.names[cell.index];
            self.notes.push(format!(
                "{name} wraps {passed} times: full turns are counted"
            ));
        }
        Ok(late::undone(time, values, cell.late_s))
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

fn notes(layout: &Layout, driven_by: Quantity) -> Vec<String> {
    let mut notes = vec![];
    if !layout.ignored.is_empty() {
        let quoted = layout.ignored.iter().map(|name| format!("{name:?}"));
        let names: Vec<String> = quoted.collect();
        let names = listed(names.iter().map(String::as_str));
        notes.push(format!("columns ignored: {names}"));
    }
    if layout.qd.is_none() {
        notes.push(
            "velocities come from the angles: slopes of cubics fitted around each row".to_owned(),
        );
    }
    let joints = Joint::all(layout.q.len()).zip(layout.tau.iter().flatten());
    for (joint, _) in joints.filter(|(_, cell)| cell.is_none()) {
        let key = driven_by.key();
        notes.push(format!(
            "joint {joint} has no column of `{key}`: read as a joint without a drive"
        ));
    }
    if layout.tau.is_none() {
        notes.push("no torque columns: read as a passive rig, with zero torque".to_owned());
    }
    notes
}
