use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::files::is_at;

/// An advisory lock, held until it is dropped or the process ends. Its file is removed when it is dropped.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    /// Locked for as long as it is open.
    _file: File,
}

impl Lock {
    /// Take the lock whose file is `path`.
    ///
    /// # Errors
    /// `WouldBlock` if another owner holds it; a file that cannot be made or locked.
    pub fn take(path: &Path) -> Result<Self, TryLockError> {
        loop {
            let mut options = OpenOptions::new();
            let opened = options.write(true).create(true).truncate(false).open(path);
            let file = opened.map_err(TryLockError::Error)?;
            file.try_lock()?;
            if is_at(&file, path).map_err(TryLockError::Error)? {
                // For people only: the lock works without it.
                let _ = file.set_len(0);
                let _ = write!(&file, "{}", std::process::id());
                return Ok(Self {
                    path: path.to_owned(),
                    _file: file,
                });
            }
            // Its last owner removed the file between the opening and the locking; the next file of that name counts.
        }
    }
}

/// The process that holds the lock whose file is `path`, if the file names it.
pub(super) fn owner(path: &Path) -> Option<u32> {
    fs::read_to_string(path).ok()?.parse().ok()
}

impl Lock {
    /// Remove the file.
    pub fn remove(&self) {
        // A file that stays is not locked once its owner has ended, and the next one takes it.
        let _ = fs::remove_file(&self.path);
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        self.remove();
    }
}
