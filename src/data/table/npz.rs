//! NumPy's `.npz`: arrays of numbers by name, a column each; of `q`, `qd` and the like with a row a sample, a column a joint.

use std::io::{Cursor, Read};
use std::path::Path;

use zip::ZipArchive;

use super::Table;
use super::npy::Array;
use crate::data::error::{CellFault, LogError, Place};

/// Columns, those that are shorter than others with empty cells at their ends.
pub(super) struct Npz {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Npz {
    /// # Errors
    /// An archive that cannot be read, and arrays of what is neither number nor text.
    pub fn of(path: &Path, bytes: Vec<u8>) -> Result<Self, LogError> {
        Self::read(bytes).map_err(|fault| LogError::Form {
            path: path.to_owned(),
            fault,
        })
    }

    fn read(bytes: Vec<u8>) -> Result<Self, String> {
        let mut table = Self {
            names: Vec::new(),
            columns: Vec::new(),
        };
        let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|why| broken(&why))?;
        for index in 0..archive.len() {
            let mut file = archive.by_index(index).map_err(|why| broken(&why))?;
            let name = file.name().map_err(|why| broken(&why))?.into_owned();
            if let Some(name) = name.strip_suffix(".npy") {
                let mut array = Vec::new();
                file.read_to_end(&mut array).map_err(|why| broken(&why))?;
                table.add(name, &array)?;
            }
        }
        Ok(table)
    }

    /// The columns of an array; one that is no table is left out, as columns are that nothing asks for.
    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let array = Array::of(bytes).ok_or_else(|| {
            format!("array {name:?} is no NumPy array; write it again with numpy.savez")
        })?;
        let (rows, columns) = match *array.shape.as_slice() {
            [rows] => (rows, 1),
            [rows, columns] => (rows, columns),
            _ => return Ok(()),
        };
        if array.is_text() {
            return Ok(());
        }
        let values = array.numbers(name)?;
        for column in 0..columns {
            let place = |row: usize| match array.by_columns {
                true => column * rows + row,
                false => row * columns + column,
            };
            self.columns
                .push((0..rows).map(|row| values[place(row)]).collect());
            self.names.push(match array.shape.len() {
                1 => name.to_owned(),
                _ => format!("{name}{}", column + 1),
            });
        }
        Ok(())
    }
}

fn broken(why: &dyn std::fmt::Display) -> String {
    format!("is no whole .npz file: {why}; write it again with numpy.savez")
}

impl Table for Npz {
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
