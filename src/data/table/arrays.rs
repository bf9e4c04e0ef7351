//! Columns of numbers in memory: what readers of binary formats make.

use super::Table;
use crate::data::error::{CellFault, LogError, Place};

/// Columns, those that are shorter than others with empty cells at their ends.
#[derive(Debug, Default)]
pub struct Arrays {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Arrays {
    pub fn add(&mut self, name: impl Into<String>, column: Vec<f64>) {
        self.names.push(name.into());
        self.columns.push(column);
    }

    /// The columns `name1`, `name2` .. of a matrix with a row a sample; one that has a single column keeps the name of a
    /// vector, `name`, where it is one.
    pub fn add_matrix(&mut self, name: &str, matrix: &Matrix, values: &[f64]) {
        // A matrix without rows may claim any number of columns.
        for column in 0..matrix.columns.min(values.len()) {
            let place = |row: usize| match matrix.by_columns {
                true => column * matrix.rows + row,
                false => row * matrix.columns + column,
            };
            let values = (0..matrix.rows).map(|row| values[place(row)]).collect();
            match matrix.is_vector {
                true => self.add(name, values),
                false => self.add(format!("{name}{}", column + 1), values),
            }
        }
    }
}

/// How the numbers of a matrix stand in a file.
pub struct Matrix {
    pub rows: usize,
    pub columns: usize,
    /// Whether a column follows the other, rather than a row.
    pub by_columns: bool,
    pub is_vector: bool,
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
}
