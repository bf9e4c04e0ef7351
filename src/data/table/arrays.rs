//! Columns of numbers in memory: what readers of binary formats make.

use std::io::Read;
use std::mem;

use super::npy::Array;
use super::room::Room;
use super::{Numbers, Numeric, Table};
use crate::data::error::{CellFault, LogError, Place};
use crate::limits::{LOG_COLUMNS, unpacked_bytes};

/// Columns, those that are shorter than others with empty cells at their ends.
#[derive(Debug)]
pub struct Arrays {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    room: Room,
    /// What a reader of the log should know about how they were read.
    pub notes: Vec<String>,
}

impl Arrays {
    /// No column yet of a file of so many bytes.
    pub fn of(packed: u64) -> Self {
        Self {
            names: Vec::new(),
            columns: Vec::new(),
            room: Room::of(packed),
            notes: Vec::new(),
        }
    }

    pub fn add(&mut self, name: impl Into<String>, column: Vec<f64>) {
        self.names.push(name.into());
        self.columns.push(column);
    }

    /// A vector is a column of its name; a matrix with a row a sample makes the columns `name1`, `name2` .. What is neither,
    /// or holds texts, is left out, as columns are that nothing asks for.
    ///
    /// # Errors
    /// An array that holds something else, or is cut off; more columns than any log has, or numbers than there is room for.
    pub(super) fn add_array(&mut self, name: &str, array: Array<impl Read>) -> Result<(), String> {
        let dimensions = array.shape.len();
        for (number, column) in (1..).zip(array.columns(name, &mut self.room)?) {
            match dimensions {
                1 => self.add(name, column),
                _ => self.add(format!("{name}{number}"), column),
            }
        }
        match self.names.len() > LOG_COLUMNS {
            true => Err(format!("has more than {LOG_COLUMNS} columns")),
            false => Ok(()),
        }
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
        unpacked_bytes(self.room.packed())
    }

    fn numbers(&mut self, wanted: &[usize]) -> Result<Numbers, LogError> {
        let rows = self.columns.iter().map(Vec::len).max().unwrap_or(0);
        // Those that nothing asks for are not kept.
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
    /// A column of a table of so many rows.
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
