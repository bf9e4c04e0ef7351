//! NumPy's `.npz`: arrays of numbers by name, a column each; of `q`, `qd` and the like with a row a sample, a column a joint.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use zip::ZipArchive;

use super::arrays::Arrays;
use super::npy::Array;
use super::unpack::Unpacking;
use crate::data::error::LogError;

/// # Errors
/// An archive that cannot be read, and arrays of what is neither number nor text.
pub(super) fn read(path: &Path, archive: impl Read + Seek) -> Result<Arrays, LogError> {
    table(archive).map_err(|fault| LogError::Form {
        path: path.to_owned(),
        fault,
    })
}

fn table(mut archive: impl Read + Seek) -> Result<Arrays, String> {
    let mut table = Arrays::default();
    let packed = archive.seek(SeekFrom::End(0));
    let mut unpacking = Unpacking::of(packed.map_err(|why| broken(&why))?);
    let mut archive = ZipArchive::new(archive).map_err(|why| broken(&why))?;
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
