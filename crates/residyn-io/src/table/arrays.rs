//! Arrays of binary formats as columns.

use std::io::Read;

use residyn_core::data::{Arrays, Table};
use residyn_core::limits::LOG_COLUMNS;

use super::npy::Array;
use super::room::Room;

/// The columns of a file as they are read from it.
pub(super) struct Unpacked {
    pub table: Arrays,
    room: Room,
}

impl Unpacked {
    /// No column yet of a file of so many bytes.
    pub fn of(packed: u64) -> Self {
        Self {
            table: Arrays::of(packed),
            room: Room::of(packed),
        }
    }

    /// A vector is a column of its name; a matrix with a row a sample makes the columns `name1`, `name2` .. What is neither,
    /// or holds texts, is left out, as columns are that nothing asks for.
    ///
    /// # Errors
    /// An array that holds something else, or is cut off; more columns than any log has, or numbers than there is room for.
    pub fn add(&mut self, name: &str, array: Array<impl Read>) -> Result<(), String> {
        let dimensions = array.shape.len();
        for (number, column) in (1..).zip(array.columns(name, &mut self.room)?) {
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
