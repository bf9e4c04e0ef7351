//! Zip archives whose files tell what they hold.

use std::io::BufReader;
use std::path::Path;

use zip::ZipArchive;

use crate::files;

/// The first bytes of an archive that is not empty.
pub(super) const BEGIN: &[u8] = b"PK\x03\x04";

/// How large the files of this name in an archive are when unpacked, in whichever folders \[bytes\]; `None` if there are
/// none, and for an archive that cannot be read.
pub(super) fn size_of(path: &Path, name: &str) -> Option<u64> {
    let file = BufReader::new(files::open(path).ok()?);
    let mut archive = ZipArchive::new(file).ok()?;
    let mut size = None;
    for index in 0..archive.len() {
        let file = archive.by_index_raw(index).ok()?;
        let own = file.name().ok()?;
        if own.rsplit('/').next() == Some(name) {
            size = Some(file.size().saturating_add(size.unwrap_or(0)));
        }
    }
    size
}
