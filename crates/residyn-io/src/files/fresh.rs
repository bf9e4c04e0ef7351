//! Files and folders that are still incomplete. Their names follow from the final names alone, so that the next writer
//! after a kill finds and replaces what is left.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

/// An empty file that is to replace `target` once it is [`complete`]. Until then it is called `.NAME.tmp` and locked, so
/// that two processes write it one after the other; if it is never completed, it is removed.
///
/// # Errors
/// A folder that cannot be written.
pub(super) fn fresh_file(target: &Path) -> io::Result<NamedTempFile> {
    let fresh = locked(hidden_beside(target, ".tmp"), File::lock)?;
    let file = fresh.as_file();
    if file.metadata()?.len() > 0 {
        // A killed process left it.
        file.set_len(0)?;
    }
    Ok(fresh)
}

/// Rename a file to the one that it is to be.
///
/// # Errors
/// A file system error; the file is then removed.
pub(super) fn complete(fresh: NamedTempFile, target: &Path) -> io::Result<()> {
    fresh.as_file().sync_all()?;
    fs::rename(fresh.path(), target)?;
    let _renamed = fresh.keep();
    Ok(())
}

/// The file at `path`, made if it is missing, once `lock` has locked it. It is removed when it is dropped.
///
/// # Errors
/// A file that cannot be made, and what `lock` returns.
pub fn locked(path: PathBuf, lock: impl Fn(&File) -> io::Result<()>) -> io::Result<NamedTempFile> {
    loop {
        if path.is_symlink() {
            // It is not followed: what it leads to is not ours.
            fs::remove_file(&path)?;
        }
        let mut options = OpenOptions::new();
        let options = options.write(true).create(true).truncate(false);
        let file = options.open(&path)?;
        lock(&file)?;
        // Its last owner may have renamed or removed it between the opening and the locking.
        if is_at(&file, &path)? {
            let path = TempPath::try_from_path(path)?;
            return Ok(NamedTempFile::from_parts(file, path));
        }
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
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
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
fn is_at(_: &File, _: &Path) -> io::Result<bool> {
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::{FreshFolder, complete, fresh_file};
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
                let fresh = fresh_file(&target).unwrap();
                assert_eq!(writers.fetch_add(1, Ordering::SeqCst), 0);
                writers.fetch_sub(1, Ordering::SeqCst);
                complete(fresh, &target).unwrap();
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
