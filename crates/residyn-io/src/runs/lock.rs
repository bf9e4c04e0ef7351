use std::fs;
use std::io::{self, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::files::locked;

/// Take the advisory lock whose file is `path`. It is held until it is dropped, which removes the file, or the process
/// ends.
///
/// # Errors
/// `WouldBlock` if another owner holds it; a file that cannot be made or locked.
pub(super) fn take(path: &Path) -> io::Result<NamedTempFile> {
    let lock = locked(path.to_owned(), |file| Ok(file.try_lock()?))?;
    // For people only: the lock works without it.
    let mut file = lock.as_file();
    let _ = file.set_len(0);
    let _ = write!(file, "{}", std::process::id());
    Ok(lock)
}

/// The process that holds the lock whose file is `path`, if the file names it.
pub(super) fn owner(path: &Path) -> Option<u32> {
    fs::read_to_string(path).ok()?.parse().ok()
}
