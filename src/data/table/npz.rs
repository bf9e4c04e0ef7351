//! NumPy's `.npz`: arrays of numbers by name, a column each; of `q`, `qd` and the like with a row a sample, a column a joint.

use std::io::Cursor;
use std::path::Path;

use zip::ZipArchive;

use super::arrays::Arrays;
use super::npy::Array;
use super::unpack::Unpacking;
use crate::data::error::LogError;

/// # Errors
/// An archive that cannot be read, and arrays of what is neither number nor text.
pub(super) fn read(path: &Path, bytes: Vec<u8>) -> Result<Arrays, LogError> {
    table(bytes).map_err(|fault| LogError::Form {
        path: path.to_owned(),
        fault,
    })
}

fn table(bytes: Vec<u8>) -> Result<Arrays, String> {
    let mut table = Arrays::default();
    let mut unpacking = Unpacking::of(bytes.len());
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|why| broken(&why))?;
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).map_err(|why| broken(&why))?;
        let name = file.name().map_err(|why| broken(&why))?.into_owned();
        if let Some(name) = name.strip_suffix(".npy") {
            let array = unpacking.read(&mut file);
            let array = array.map_err(|why| format!("array {name:?}: {why}"))?;
            let array = Array::of(&array).ok_or_else(|| {
                format!("array {name:?} is no NumPy array; write it again with numpy.savez")
            })?;
            table.add_array(name, &array)?;
        }
    }
    Ok(table)
}

fn broken(why: &dyn std::fmt::Display) -> String {
    format!("is no whole .npz file: {why}; write it again with numpy.savez")
}
