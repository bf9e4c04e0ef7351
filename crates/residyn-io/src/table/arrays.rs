//! Arrays of binary formats as columns.

use std::io::Read;

use residyn_core::data::{Arrays, Table};
use residyn_core::limits::LOG_COLUMNS;

use super::budget::Budget;
use super::npy::Array;

/// The columns of a file as they are read from it.
pub(super) struct Unpacked {
    pub table: Arrays,
    budget: Budget,
}

impl Unpacked {
    /// No columns yet, for a file of `packed` bytes.
    pub fn of(packed: u64) -> Self {
        Self {
            table: Arrays::of(packed),
            budget: Budget::of(packed),
        }
    }

    /// A vector becomes a column of its name, and a single number a value; a matrix with one row per sample becomes the
    /// columns `name1`, `name2` .. Other arrays, and arrays of texts, are left out, as are columns that nothing asks for.
    ///
    /// # Errors
    /// As [`Unpacked::add_as`].
    pub fn add(&mut self, name: &str, array: Array<impl Read>) -> Result<(), String> {
        let is_one_column = array.shape.len() < 2 || array.shape.iter().all(|size| *size == 1);
        self.add_as(name, array, |column| match is_one_column {
            true => name.to_owned(),
            false => format!("{name}{}", column + 1),
        })
    }

    /// As [`Unpacked::add`], with these names for the columns, counted from 0.
    ///
    /// # Errors
    /// An array that holds something else, or is cut off; more columns than any log has, or more numbers than there is
    /// room for.
    pub fn add_as(
        &mut self,
        name: &str,
        array: Array<impl Read>,
        of_column: impl Fn(usize) -> String,
    ) -> Result<(), String> {
        let columns = array.columns(name, &mut self.budget)?;
        for (index, column) in columns.into_iter().enumerate() {
            match column[..] {
                [value] => self.table.values.push((of_column(index), value)),
                _ => self.table.add(of_column(index), column),
            }
        }
        match self.table.names().len() > LOG_COLUMNS {
            true => Err(format!("has more than {LOG_COLUMNS} columns")),
            false => Ok(()),
        }
    }

    /// Counts bytes that are unpacked on the way to the numbers.
    ///
    /// # Errors
    /// More than there is room for.
    pub fn take(&mut self, bytes: u64) -> Result<(), String> {
        let taken = self.budget.take(bytes);
        taken.map_err(|why| format!("is too large: {why}"))
    }
}
