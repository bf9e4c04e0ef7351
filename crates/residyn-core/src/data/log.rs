//! One trajectory of a rig, in memory and as a file.

use std::borrow::Cow;
use std::fmt;
use std::io::{self, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::column::Quantity;
use super::columns::Columns;
use super::error::{CellFault, LogError, Place};
use super::instant::SAME_S;
use super::joint::{Joint, of_joints};
use super::jumps::{bridge, rows_that_jump};
use super::measured::Measured;
use super::signal::differences;
use super::statistics::median_of;
use super::torque_column::TorqueColumn;
use crate::limits::is_reading;

/// A span of a log's own time, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Where it begins \[s\], on the log's time axis.
    pub start_s: f64,
    /// Where it ends \[s\], on the log's time axis.
    pub end_s: f64,
}

impl Interval {
    /// Length \[s\].
    pub fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }

    /// Whether it overlaps or touches another span \[s\].
    pub fn touches(&self, from_s: f64, to_s: f64) -> bool {
        self.start_s <= to_s + SAME_S && self.end_s >= from_s - SAME_S
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { start_s, end_s } = self;
        write!(f, "{start_s} to {end_s} s")
    }
}

/// One trajectory of a rig with N joints.
///
/// The channels are indexed `[joint][row]`; each of them has as many rows as `time`, which increases
/// strictly. [`Log::of_table`] guarantees this, and that every number is finite; code that
/// builds a log itself has to as well.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// Where the log was read from, as the caller gave it.
    pub path: PathBuf,
    /// Time of each row \[s\].
    pub time: Vec<f64>,
    /// Joint angles \[rad\], counted through full turns.
    pub q: Vec<Vec<f64>>,
    /// Joint velocities \[rad/s\] as the rig reports them.
    pub qd: Vec<Vec<f64>>,
    /// Whether the velocities are slopes of the angles, since no column holds any.
    pub is_qd_derived: bool,
    /// What drives the joints: torques \[N m\] or commands; row i acts from `time[i]` to `time[i + 1]`,
    /// unless `torque` says otherwise.
    pub tau: Vec<Vec<f64>>,
    /// Which of the two: [`Quantity::Torque`] or [`Quantity::Command`].
    pub driven_by: Quantity,
    /// What these are: held from row to row, readings at the rows, or means.
    pub torque: TorqueColumn,
    /// Further measured columns, whose rows are held until the next: those of the model that the log was read for, in
    /// its order, then others.
    pub measured: Vec<Measured>,
    /// Rows whose angle jumps, or repeats a reading, and is not to be fitted, `[joint]`, in ascending order. The angle
    /// there is interpolated from the rows around. May be empty: none in a log as it is read.
    pub masked: Vec<Vec<usize>>,
    /// Rows inserted where the logger dropped some, in ascending order: all their channels are interpolated from the
    /// rows around. None in a log as it is read.
    pub filled: Vec<usize>,
    /// Intervals that are neither fitted nor scored, for instance because a person touched the rig.
    pub leave_out: Vec<Interval>,
    /// Single numbers that the recording has besides its columns, by name.
    pub values: Vec<(String, f64)>,
    /// What a reader of the log should know about how it was read, one sentence each.
    pub notes: Vec<String>,
}

impl Log {
    /// A log with this number of joints and no row, for recording torques.
    pub fn empty(joints: usize) -> Self {
        Self {
            path: PathBuf::new(),
            time: Vec::new(),
            q: vec![Vec::new(); joints],
            qd: vec![Vec::new(); joints],
            is_qd_derived: false,
            tau: vec![Vec::new(); joints],
            driven_by: Quantity::Torque,
            torque: TorqueColumn::Held,
            measured: Vec::new(),
            masked: vec![Vec::new(); joints],
            filled: Vec::new(),
            leave_out: Vec::new(),
            values: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.time.len()
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.q.len()
    }

    /// Time from the first to the last row \[s\]; 0 for a log without rows.
    pub fn duration(&self) -> f64 {
        match (self.time.first(), self.time.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// Median time between neighbouring rows \[s\]; 0 for fewer than two rows.
    pub fn median_step(&self) -> f64 {
        median_of(differences(&self.time))
    }

    /// The file's name without its folder.
    pub fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }

    /// Whether `name` is the log's path as the caller gave it, or its file name.
    pub fn is_called(&self, name: &str) -> bool {
        self.path.as_os_str() == name || self.name() == name
    }

    /// Whether the angle of a joint, counted from 0, is not to be fitted at a row.
    pub fn is_masked(&self, joint: usize, row: usize) -> bool {
        let jumps = self.masked.get(joint);
        jumps.is_some_and(|rows| rows.binary_search(&row).is_ok())
            || self.filled.binary_search(&row).is_ok()
    }

    /// Whether the logger dropped none of these rows.
    pub fn is_whole(&self, rows: RangeInclusive<usize>) -> bool {
        let first = self.filled.partition_point(|row| row < rows.start());
        self.filled.get(first).is_none_or(|row| row > rows.end())
    }

    /// The channels of these joints alone.
    #[must_use]
    pub(crate) fn of_joints(&self, joints: &[Joint]) -> Self {
        Self {
            q: of_joints(&self.q, joints),
            qd: of_joints(&self.qd, joints),
            tau: of_joints(&self.tau, joints),
            masked: of_joints(&self.masked, joints),
            ..self.clone()
        }
    }

    /// The log as fits read it: readings that jump or repeat those before are masked, and rows that the logger dropped
    /// are filled in, or left out with the windows of `window_s` around them.
    #[must_use]
    pub fn for_fits(&self, window_s: f64) -> Log {
        let (log, _) = self.without_repeats();
        let jumps: Vec<Vec<usize>> = log.q.iter().map(|q| rows_that_jump(q)).collect();
        log.without(&jumps).into_owned().completed(window_s)
    }

    /// The log with angles masked at these rows, at which they jump, `[joint]`.
    pub(super) fn without(&self, jumps: &[Vec<usize>]) -> Cow<'_, Log> {
        if jumps.iter().all(Vec::is_empty) {
            return Cow::Borrowed(self);
        }
        let mut log = self.clone();
        for ((q, masked), rows) in log.q.iter_mut().zip(&mut log.masked).zip(jumps) {
            bridge(&self.time, q, rows);
            masked.extend(rows);
            masked.sort_unstable();
            masked.dedup();
        }
        Cow::Owned(log)
    }

    /// The columns, named and ordered as in a file that is written: `time`, `q1`, ..., `qd1`, ..., `tau1` or `cmd1`,
    /// ..., `u_NAME`, ...
    pub fn named_columns(&self) -> impl Iterator<Item = (String, &[f64])> {
        let standard = Columns::standard(self.joints(), self.driven_by);
        let names = standard.in_file_order().map(|column| &column.name);
        let measured = self.measured.iter().map(|measured| &measured.name);
        let names: Vec<String> = names.chain(measured).cloned().collect();
        names.into_iter().zip(self.columns().map(Vec::as_slice))
    }

    /// The columns in file order.
    fn columns(&self) -> impl Iterator<Item = &Vec<f64>> {
        std::iter::once(&self.time)
            .chain(&self.q)
            .chain(&self.qd)
            .chain(&self.tau)
            .chain(self.measured.iter().map(|measured| &measured.values))
    }

    /// The columns of a quantity, one for each joint except for the time; measured columns are of no joint.
    pub(super) fn of_mut(&mut self, quantity: Quantity) -> &mut [Vec<f64>] {
        match quantity {
            Quantity::Time => std::slice::from_mut(&mut self.time),
            Quantity::Angle => &mut self.q,
            Quantity::Velocity => &mut self.qd,
            Quantity::Torque | Quantity::Command => &mut self.tau,
            Quantity::Measured => &mut [],
        }
    }

    /// Checks that a reader would accept every number of the log as a file at `path`.
    ///
    /// # Errors
    /// [`LogError::Cell`] for a number that is beyond [`READING`](crate::limits::READING) or not finite.
    pub fn check_readings(&self, path: &Path) -> Result<(), LogError> {
        for (column, values) in self.named_columns() {
            if let Some(row) = values.iter().position(|value| !is_reading(*value)) {
                return Err(LogError::Cell {
                    path: path.to_owned(),
                    // The header is line 1.
                    place: Place::Line(row + 2),
                    column,
                    fault: CellFault::of_number(values[row]),
                });
            }
        }
        Ok(())
    }

    /// The log as CSV with the standard header `time,q1..,qd1..,tau1..`, or `cmd1..`, and the further measured columns.
    ///
    /// Every number is the shortest text that reads back as the same number. Left-out intervals and notes are not part of
    /// the text.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_csv(&self, out: &mut dyn Write) -> io::Result<()> {
        let header: Vec<String> = self.named_columns().map(|(name, _)| name).collect();
        writeln!(out, "{}", header.join(","))?;
        for row in 0..self.rows() {
            // `{:?}` of a float is its shortest text that reads back the same, with an exponent
            // where the plain digits would be long.
            let cells: Vec<String> = self
                .columns()
                .map(|values| format!("{:?}", values[row]))
                .collect();
            writeln!(out, "{}", cells.join(","))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_steps_of_tiny_logs_are_defined() {
        let mut log = Log {
            time: vec![0.0, 0.1, 0.3],
            ..Log::empty(2)
        };
        assert_eq!((log.rows(), log.joints()), (3, 2));
        assert!((log.median_step() - 0.15).abs() < 1e-12);
        log.time.clear();
        assert_eq!((log.duration(), log.median_step()), (0.0, 0.0));
    }
}
