//! Columns of numbers in memory: what readers of binary formats make.

use super::Table;
use super::npy::Array;
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

    fn rows(&self) -> usize {
        self.columns.iter().map(Vec::len).max().unwrap_or(0)
    }

    fn check(&self) -> Result<(), LogError> {
        Ok(())
    }

    fn number(&self, row: usize, column: usize) -> Result<f64, CellFault> {
        let value = self.columns[column].get(row).ok_or(CellFault::Empty)?;
        match value.is_finite() {
            true => Ok(*value),
            false => Err(CellFault::NotFinite(value.to_string())),
        }
    }

    fn place(&self, row: usize) -> Place {
        Place::Row(row + 1)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}
