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

/// The numbers of a column up to its first cell that is not a finite number, and what is wrong with that cell.
#[derive(Clone, Default)]
pub struct Numeric {
    pub values: Vec<f64>,
    pub fault: Option<CellFault>,
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
            match number() {
                Ok(number) => self.values.push(number),
                Err(fault) => self.fault = Some(fault),
            }
        }
    }
}

/// Columns of numbers in memory; those that are shorter than others have empty cells at their ends.
#[derive(Debug)]
pub struct Arrays {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    most_bytes: u64,
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
            notes: Vec::new(),
        }
    }

    pub fn add(&mut self, name: impl Into<String>, column: Vec<f64>) {
        self.names.push(name.into());
        self.columns.push(column);
    }
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

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl Numeric {
    /// A column of a table with this many rows.
    fn of(mut values: Vec<f64>, rows: usize) -> Self {
        let bad = values.iter().position(|value| !value.is_finite());
        let fault = match bad {
            Some(row) => Some(CellFault::NotFinite(values[row].to_string())),
            None => (values.len() < rows).then_some(CellFault::Empty),
        };
        values.truncate(bad.unwrap_or(rows));
        Self { values, fault }
    }
}
