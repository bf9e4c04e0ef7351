//! Named columns of numbers from which a log is made, in memory or as the reader of a format finds them in a file.

use std::mem;

use super::error::{CellFault, LogError, Place};
use crate::limits::unpacked_bytes;

/// Named columns of numbers.
pub trait Table {
    fn names(&self) -> &[String];

    /// Where the names are.
    fn head(&self) -> Place;

    /// Memory that the numbers of a log from it may take \[bytes\].
    fn most_bytes(&self) -> u64;

    /// The numbers of these columns, in this order. They can be requested only once.
    ///
    /// # Errors
    /// A file that cannot be read to its end.
    fn numbers(&mut self, wanted: &[usize]) -> Result<Numbers, LogError>;

    /// Where a row is.
    ///
    /// # Errors
    /// A file that cannot be read again.
    fn place(&self, row: usize) -> Result<Place, LogError>;

    /// Single numbers that it has besides its columns, by name.
    fn values(&self) -> &[(String, f64)] {
        &[]
    }

    /// What a reader of the log should know about how the file was read.
    fn notes(&self) -> &[String] {
        &[]
    }
}

/// Columns of a table, each up to the first cell that cannot be read.
pub struct Numbers {
    /// Number of rows of the table.
    pub rows: usize,
    pub columns: Vec<Numeric>,
    /// The first row that does not have one cell for each name, and how many cells it has. Nothing is read from there
    /// on.
    pub ragged: Option<(usize, usize)>,
}

/// The numbers of a column up to its first cell that holds something else.
#[derive(Clone, Default)]
pub struct Numeric {
    /// NaN where a cell is empty.
    pub values: Vec<f64>,
    /// The first empty cell, its row and what is wrong with it.
    pub gap: Option<(usize, CellFault)>,
    /// The row at which the numbers end, and what is wrong with its cell.
    pub fault: Option<(usize, CellFault)>,
}

impl Numbers {
    /// This many columns without rows.
    pub fn of(columns: usize) -> Self {
        Self {
            rows: 0,
            columns: vec![Numeric::default(); columns],
            ragged: None,
        }
    }
}

impl Numeric {
    /// Reads one more cell.
    pub fn push(&mut self, number: impl FnOnce() -> Result<f64, CellFault>) {
        if self.fault.is_none() {
            let row = self.values.len();
            match number() {
                Ok(number) => self.values.push(number),
                Err(fault) if fault.is_gap() => {
                    self.gap.get_or_insert((row, fault));
                    self.values.push(f64::NAN);
                }
                Err(fault) => self.fault = Some((row, fault)),
            }
        }
    }

    /// Whether a row has no value.
    pub fn is_empty_at(&self, row: usize) -> bool {
        self.values.get(row).is_none_or(|value| value.is_nan())
    }

    /// The same if no cell may be empty: the numbers end at the first.
    #[must_use]
    pub fn without_gaps(mut self) -> Self {
        if let Some((row, fault)) = self.gap.take() {
            self.values.truncate(row);
            self.fault = Some((row, fault));
        }
        self
    }
}

/// Columns of numbers in memory; those that are shorter than others have empty cells at their ends.
#[derive(Debug)]
pub struct Arrays {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    most_bytes: u64,
    /// Single numbers besides the columns, by name.
    pub values: Vec<(String, f64)>,
    /// What a reader of the log should know about how they were read.
    pub notes: Vec<String>,
}

impl Arrays {
    /// No columns yet, for a file of this many bytes.
    pub fn of(packed: u64) -> Self {
        Self {
            names: Vec::new(),
            columns: Vec::new(),
            most_bytes: unpacked_bytes(packed),
            values: Vec::new(),
            notes: Vec::new(),
        }
    }

    pub fn add(&mut self, name: impl Into<String>, column: Vec<f64>) {
        self.names.push(name.into());
        self.columns.push(column);
    }

    /// The same on the clock of the column `time`: a column with times of its own, `cmd_time` those of `cmd1` and `cmd2`, holds
    /// from one value to the next. Rows before its first are dropped.
    #[must_use]
    pub fn on_one_clock(mut self) -> Self {
        let of = |name: &str| self.names.iter().position(|own| own == name);
        let Some(time) = of("time") else {
            return self;
        };
        let clocks = self.names.iter().enumerate();
        let clocks =
            clocks.filter_map(|(k, name)| Some((k, name.strip_suffix("_time")?.to_owned())));
        for (clock, stem) in clocks.collect::<Vec<_>>() {
            self.hold(time, clock, &stem);
        }
        self
    }

    /// Holds the columns of a stem, which are on the clock of one column, at the times of another.
    fn hold(&mut self, time: usize, clock: usize, stem: &str) {
        let own = self.columns[clock].clone();
        let is_of_stem = |name: &String| name.strip_prefix(stem).is_some_and(is_of_joint);
        let held: Vec<usize> = (0..self.names.len())
            .filter(|k| *k != clock && is_of_stem(&self.names[*k]))
            .filter(|k| self.columns[*k].len() == own.len())
            .collect();
        if held.is_empty() || own.is_empty() || !own.is_sorted() {
            return;
        }
        let times = &self.columns[time];
        let early = times.partition_point(|time| own.first().is_some_and(|first| time < first));
        let rows = times.len();
        let last = times[early..]
            .iter()
            .map(|time| own.partition_point(|own| own <= time));
        let last: Vec<usize> = last.map(|count| count.saturating_sub(1)).collect();
        for (k, column) in self.columns.iter_mut().enumerate() {
            if held.contains(&k) {
                *column = last.iter().map(|row| column[*row]).collect();
            } else if column.len() == rows {
                column.drain(..early);
            }
        }
        self.notes.push(format!(
            "{stem} is on the clock {}: each value holds until the next; {early} rows before its first are left out",
            self.names[clock]
        ));
    }
}

/// Whether this follows the stem in the name of a joint's column: `1`, `_elbow`, or nothing.
fn is_of_joint(rest: &str) -> bool {
    rest.starts_with('_') || rest.bytes().all(|byte| byte.is_ascii_digit())
}

impl Table for Arrays {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn head(&self) -> Place {
        Place::Arrays
    }

    fn most_bytes(&self) -> u64 {
        self.most_bytes
    }

    fn numbers(&mut self, wanted: &[usize]) -> Result<Numbers, LogError> {
        let rows = self.columns.iter().map(Vec::len).max().unwrap_or(0);
        // Columns that are not requested are not kept.
        let mut columns = mem::take(&mut self.columns);
        let column = |(asked, index): (usize, &usize)| {
            let is_asked_again = wanted[asked + 1..].contains(index);
            let values = match is_asked_again {
                true => columns[*index].clone(),
                false => mem::take(&mut columns[*index]),
            };
            Numeric::of(values, rows)
        };
        Ok(Numbers {
            rows,
            columns: wanted.iter().enumerate().map(column).collect(),
            ragged: None,
        })
    }

    fn place(&self, row: usize) -> Result<Place, LogError> {
        Ok(Place::Row(row + 1))
    }

    fn values(&self) -> &[(String, f64)] {
        &self.values
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl Numeric {
    /// A column of a table with this many rows.
    fn of(values: Vec<f64>, rows: usize) -> Self {
        let mut column = Self::default();
        column.values.reserve_exact(values.len());
        let is_short = values.len() < rows;
        for value in values {
            column.push(|| match value.is_finite() {
                true => Ok(value),
                false => Err(CellFault::NotFinite(value.to_string())),
            });
        }
        if is_short && column.fault.is_none() {
            column.fault = Some((column.values.len(), CellFault::Empty));
        }
        column
    }
}
