//! Files and folders that are still incomplete. Their names follow from the final names alone, so that the next writer
//! after a kill finds and removes what is left.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use tempfile::TempPath;

/// A file that replaces another once it is complete. Until then it is called `.NAME.tmp` and locked, so that two
/// processes write it one after the other; if it is never completed, it is removed.
pub(super) struct Fresh {
    pub file: File,
    path: TempPath,
}

impl Fresh {
    /// An empty file next to `target`.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn beside(target: &Path) -> io::Result<Self> {
        let path = hidden_beside(target, ".tmp");
        loop {
            // Created anew: a link of this name is not followed.
            let made = OpenOptions::new().write(true).create_new(true).open(&path);
            let file = match made {
                Ok(file) => file,
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    remove_left(&path)?;
                    continue;
                }
                Err(error) => return Err(error),
            };
            if let Err(error) = file.lock() {
                let _ = fs::remove_file(&path);
                return Err(error);
            }
            // Between creating and locking it, another process may have taken it for a leftover.
            if is_at(&file, &path)? {
                let path = TempPath::try_from_path(path)?;
                return Ok(Self { file, path });
            }
        }
    }

    /// Rename it to the file that it is to be.
    ///
    /// # Errors
    /// A file system error; the file is then removed.
    pub fn become_file(self, target: &Path) -> io::Result<()> {
        self.file.sync_all()?;
        fs::rename(&self.path, target)?;
        let _renamed = self.path.keep();
        Ok(())
    }
}

/// Remove a file that a killed process left. If it is being written, wait for that.
fn remove_left(path: &Path) -> io::Result<()> {
    match File::open(path) {
        Ok(left) => {
            left.lock()?;
            match is_at(&left, path)? {
                true => fs::remove_file(path),
                false => Ok(()),
            }
        }
        // A link that leads nowhere, or a file that has just been renamed.
        Err(error) if error.kind() == ErrorKind::NotFound => match path.is_symlink() {
            true => fs::remove_file(path),
            false => Ok(()),
        },
        Err(error) => Err(error),
    }
}

/// A folder that replaces another once it is complete: `.NAME.new` next to it until then. If it is never completed, it
/// is removed with its contents.
pub struct FreshFolder(PathBuf);

impl FreshFolder {
    /// An empty folder. The caller owns `target`: an existing folder of this name was left by a killed program.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn beside(target: &Path) -> io::Result<Self> {
        let path = hidden_beside(target, ".new");
        remove_folder(&path)?;
        fs::create_dir(&path)?;
        Ok(Self(path))
    }

    /// Where it is, until it is renamed.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for FreshFolder {
    fn drop(&mut self) {
        // If it stays, the next process that makes it removes it.
        let _ = remove_folder(&self.0);
    }
}

/// Remove a folder if it exists.
///
/// # Errors
/// A folder that cannot be removed.
pub fn remove_folder(path: &Path) -> io::Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// The hidden name of a file or folder that belongs to `path`, in the same folder: `.NAME` and the ending.
pub fn hidden_beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(ending);
    path.with_file_name(name)
}

/// Whether `path` is still the name of `file`.
///
/// # Errors
/// What the system reports.
#[cfg(unix)]
pub fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let identity = |found: fs::Metadata| (found.dev(), found.ino());
    match fs::metadata(path) {
        Ok(found) => Ok(identity(found) == identity(file.metadata()?)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// On other systems an open file keeps its name.
#[cfg(not(unix))]
pub fn is_at(_: &File, _: &Path) -> io::Result<bool> {
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::{Fresh, FreshFolder};
    use crate::files::write_whole;

    #[test]
    fn what_a_killed_process_left_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (target, left) = (
            folder.path().join("a.txt"),
            folder.path().join(".a.txt.tmp"),
        );
        fs::write(&left, "half").unwrap();
        write_whole(&target, b"whole").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"whole");
        #[cfg(unix)]
        for end in ["other", "none"] {
            fs::write(folder.path().join("other"), "mine").unwrap();
            std::os::unix::fs::symlink(end, &left).unwrap();
            write_whole(&target, b"again").unwrap();
            assert_eq!(fs::read(folder.path().join("other")).unwrap(), b"mine");
            fs::remove_file(folder.path().join("other")).unwrap();
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let left = folder.path().join(".run.new");
        fs::create_dir(&left).unwrap();
        fs::write(left.join("half"), "").unwrap();
        let fresh = FreshFolder::beside(&folder.path().join("run")).unwrap();
        assert_eq!(fs::read_dir(fresh.path()).unwrap().count(), 0);
    }

    #[test]
    fn threads_write_a_file_one_after_the_other() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.txt");
        let writers = AtomicUsize::new(0);
        let work = || {
            for _ in 0..200 {
                let fresh = Fresh::beside(&target).unwrap();
                assert_eq!(writers.fetch_add(1, Ordering::SeqCst), 0);
                writers.fetch_sub(1, Ordering::SeqCst);
                fresh.become_file(&target).unwrap();
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(work);
            }
        });
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
