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

    /// A vector becomes a column of its name; a matrix with one row per sample becomes the columns `name1`, `name2` ..
    /// Other arrays, and arrays of texts, are left out, as are columns that nothing asks for.
    ///
    /// # Errors
    /// An array that holds something else, or is cut off; more columns than any log has, or more numbers than there is
    /// room for.
    pub fn add(&mut self, name: &str, array: Array<impl Read>) -> Result<(), String> {
        let dimensions = array.shape.len();
        for (number, column) in (1..).zip(array.columns(name, &mut self.budget)?) {
            match dimensions {
                1 => self.table.add(name, column),
                _ => self.table.add(format!("{name}{number}"), column),
            }
        }
        match self.table.names().len() > LOG_COLUMNS {
            true => Err(format!("has more than {LOG_COLUMNS} columns")),
            false => Ok(()),
        }
    }
}
