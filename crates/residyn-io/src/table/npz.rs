//! NumPy's `.npz`: named arrays of numbers, one column each; arrays such as `q` and `qd` may have one row per sample
//! and one column per joint.

use std::io::{BufReader, Read, Seek};
use std::path::Path;

use zip::ZipArchive;

use residyn_core::data::{Arrays, LogError};

use super::arrays::Unpacked;
use super::npy::Array;
use crate::files;

/// # Errors
/// An archive that cannot be read, and arrays of neither numbers nor texts.
pub(super) fn read(path: &Path) -> Result<Arrays, LogError> {
    let unreadable = LogError::open(path);
    let file = files::open(path).map_err(&unreadable)?;
    let packed = file.metadata().map_err(unreadable)?.len();
    table(packed, BufReader::new(file)).map_err(|fault| LogError::form(path, fault))
}

fn table(packed: u64, archive: impl Read + Seek) -> Result<Arrays, String> {
    let mut unpacked = Unpacked::of(packed);
    let mut archive = ZipArchive::new(archive).map_err(|why| broken(&why))?;
    for index in 0..archive.len() {
        let file = archive.by_index(index).map_err(|why| broken(&why))?;
        let name = file.name().map_err(|why| broken(&why))?.into_owned();
        if let Some(name) = name.strip_suffix(".npy") {
            let array = Array::of(file).ok_or_else(|| {
                format!("array {name:?} is not a NumPy array; write it again with numpy.savez")
            })?;
            unpacked.add(name, array)?;
        }
    }
    Ok(unpacked.table.on_one_clock())
}

fn broken(why: &dyn std::fmt::Display) -> String {
    format!("is not a complete .npz file: {why}; write it again with numpy.savez")
}
