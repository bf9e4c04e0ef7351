//! Columns of numbers in memory: what readers of binary formats make.

use std::mem;

use super::npy::Array;
use super::{Numbers, Numeric, Table};
use crate::data::error::{CellFault, LogError, Place};

/// Columns, those that are shorter than others with empty cells at their ends.
#[derive(Debug, Default)]
pub struct Arrays {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// What a reader of the log should know about how they were read.
    pub notes: Vec<String>,
}

impl Arrays {
    pub fn add(&mut self, name: impl Into<String>, column: Vec<f64>) {
        self.names.push(name.into());
        self.columns.push(column);
    }

    /// A vector is a column of its name; a matrix with a row a sample makes the columns `name1`, `name2` .. What is neither,
    /// or holds texts, is left out, as columns are that nothing asks for.
    ///
    /// # Errors
    /// An array that holds something else, or is cut off.
    pub(super) fn add_array(&mut self, name: &str, array: &Array<'_>) -> Result<(), String> {
        let (rows, columns) = match *array.shape.as_slice() {
            [rows] => (rows, 1),
            [rows, columns] => (rows, columns),
            _ => return Ok(()),
        };
        if array.is_text() {
            return Ok(());
        }
        let values = array.numbers(name)?;
        // Without rows, any number of columns may be claimed.
        for column in 0..columns.min(values.len()) {
            let place = |row: usize| match array.by_columns {
                true => column * rows + row,
                false => row * columns + column,
            };
            let values = (0..rows).map(|row| values[place(row)]).collect();
            match array.shape.len() {
                1 => self.add(name, values),
                _ => self.add(format!("{name}{}", column + 1), values),
            }
        }
        Ok(())
    }
}

impl Table for Arrays {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn head(&self) -> Place {
        Place::Arrays
    }

    fn numbers(&mut self, wanted: &[usize]) -> Result<Numbers, LogError> {
        let rows = self.columns.iter().map(Vec::len).max().unwrap_or(0);
        let column = |(asked, index): (usize, &usize)| {
            let is_asked_again = wanted[asked + 1..].contains(index);
            let values = match is_asked_again {
                true => self.columns[*index].clone(),
                false => mem::take(&mut self.columns[*index]),
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
