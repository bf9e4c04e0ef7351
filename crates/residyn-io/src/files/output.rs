use std::fs;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::fresh::{complete, fresh_file, hidden_beside, remove_folder};
use super::input::{kind, listed};

/// As many links as Linux follows.
const MOST_LINKS: usize = 40;

/// An output file that cannot be written. What was there before is unchanged, and no part of the new file is left.
#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot be written: {source}", path = .path.display())]
pub struct OutputError {
    pub path: PathBuf,
    pub source: io::Error,
}

impl OutputError {
    /// The system's error for `path`.
    pub fn of(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self { path, source }
    }
}

/// What a run may write, as far as known in advance \[bytes\].
const ROOM: usize = 4 << 20;

/// Check that results can be written to `path`, a file or a folder that need not exist, before they are computed.
///
/// # Errors
/// A folder that cannot be written, or that has no room.
pub fn check_room(path: &Path) -> Result<(), OutputError> {
    let folder = path.ancestors().find(|folder| folder.is_dir());
    let folder = folder.unwrap_or(Path::new("."));
    let room = || {
        let probe = fresh_file(&folder.join("room"))?;
        probe.as_file().write_all(&vec![0; ROOM])
    };
    room().map_err(OutputError::of(path))
}

/// Write a file whole or not at all: under a temporary name in the same folder, `.NAME.tmp`, which is then renamed. Symbolic
/// links are followed, so that the file that a link points to is written and the link stays.
///
/// # Errors
/// A folder that does not exist or cannot be written, a full disk, or a `path` that is not a regular file (a folder, a
/// device, a pipe).
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    write_with(path, |file| file.write_all(contents))
}

/// [`write_whole`] for contents that `write` produces piece by piece.
///
/// # Errors
/// As [`write_whole`], and what `write` returns.
pub fn write_with(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), OutputError> {
    let written = || {
        let target = target_of(path)?;
        let folder = folder_of(&target);
        if !folder.is_dir() {
            let missing = "its folder does not exist";
            return Err(io::Error::new(ErrorKind::NotFound, missing));
        }
        let fresh = fresh_file(&target)?;
        let mut buffer = BufWriter::new(fresh.as_file());
        write(&mut buffer)?;
        buffer.flush()?;
        drop(buffer);
        complete(fresh, &target)
    };
    written().map_err(OutputError::of(path))
}

/// Move all files and folders in the folder `from` into the folder `to`: each file as [`write_whole`] would write it
/// there, each folder replacing the one of its name. Either all of them can be placed, or none is moved. If `to` does
/// not exist yet, `from` is renamed to it, all at once.
///
/// # Errors
/// A file whose place is taken by something other than a regular file, a folder whose place is taken by a file, or as
/// [`write_whole`].
pub fn move_contents(from: &Path, to: &Path) -> Result<(), OutputError> {
    let to = &end_of_links(to);
    if !to.exists() {
        return fs::rename(from, to).map_err(OutputError::of(to));
    }
    let entries = listed(from).map_err(OutputError::of(from))?;
    let pair = |from: PathBuf| {
        let to = to.join(from.file_name().unwrap_or_default());
        (from, to)
    };
    let pairs: Vec<_> = entries.into_iter().map(pair).collect();
    for (from, to) in &pairs {
        check_target(from, to).map_err(OutputError::of(to))?;
    }
    for (from, to) in &pairs {
        if from.is_dir() {
            replace_folder(from, to).map_err(OutputError::of(to))?;
        } else {
            move_file(from, to)?;
        }
    }
    Ok(())
}

/// Whether `from` can take the place of what is at `to`.
fn check_target(from: &Path, to: &Path) -> io::Result<()> {
    if !from.is_dir() {
        return target_of(to).map(drop);
    }
    if to.exists() && !to.is_dir() {
        let message = "it is not a folder";
        return Err(io::Error::new(ErrorKind::InvalidInput, message));
    }
    Ok(())
}

/// A folder is moved away before another takes its place, so that a partly removed folder never has its name.
fn replace_folder(from: &Path, to: &Path) -> io::Result<()> {
    let older = hidden_beside(from, ".old");
    if to.is_dir() {
        fs::rename(to, &older)?;
    }
    if let Err(error) = fs::rename(from, to) {
        // If this fails too, there is nothing better to do.
        let _ = fs::rename(&older, to);
        return Err(error);
    }
    remove_folder(&older)
}

fn move_file(from: &Path, to: &Path) -> Result<(), OutputError> {
    let moved = target_of(to).and_then(|target| fs::rename(from, target));
    match moved {
        // A link may lead to another file system, where a file can only be written anew.
        Err(error) if error.kind() == ErrorKind::CrossesDevices => write_with(to, |file| {
            io::copy(&mut fs::File::open(from)?, file).map(drop)
        }),
        moved => moved.map_err(OutputError::of(to)),
    }
}

/// The folder that contains `path`; `.` for a bare name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// The regular file, which need not exist yet, that `path` leads to when links are followed.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    match fs::metadata(path) {
        Ok(found) if found.is_file() => fs::canonicalize(path),
        Ok(found) => {
            let message = format!("it is {}, not a regular file", kind(&found));
            Err(io::Error::new(ErrorKind::InvalidInput, message))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(end_of_links(path)),
        Err(error) => Err(error),
    }
}

/// Where `path` leads when links are followed, even if they end at nothing. Links that form a loop are followed for a
/// while; whoever uses the result gets the system's error.
pub fn end_of_links(path: &Path) -> PathBuf {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&at) {
            Ok(next) => at = folder_of(&at).join(next),
            Err(_) => break,
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{ErrorKind, io, move_contents, write_whole, write_with};

    #[test]
    fn a_failure_leaves_the_file_that_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_whole(&path, b"first").unwrap();
        let broken = write_with(&path, |file| {
            file.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        let message = broken.unwrap_err().to_string();
        assert!(message.ends_with("a.txt: cannot be written: the disk is full"));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let missing = write_whole(&folder.path().join("none/a.txt"), b"").unwrap_err();
        assert!(missing.to_string().contains("its folder does not exist"));
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed_and_stay() {
        let (folder, elsewhere) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let (link, file) = (
            folder.path().join("link"),
            elsewhere.path().join("file.txt"),
        );
        // The first link is relative, and at first its end does not exist.
        std::os::unix::fs::symlink(&file, folder.path().join("second")).unwrap();
        std::os::unix::fs::symlink("second", &link).unwrap();
        for contents in [b"first!", b"second"] {
            write_whole(&link, contents).unwrap();
            assert_eq!(fs::read(&file).unwrap(), contents);
        }
        let staged = tempfile::tempdir().unwrap();
        fs::write(staged.path().join("link"), "third").unwrap();
        move_contents(staged.path(), folder.path()).unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"third");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_dir(elsewhere.path()).unwrap().count(), 1);
        let looped = folder.path().join("loop");
        std::os::unix::fs::symlink("loop", &looped).unwrap();
        assert!(write_whole(&looped, b"").is_err());
    }

    #[test]
    #[cfg(unix)]
    fn what_is_no_regular_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("device");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        for (path, kind) in [(device.as_path(), "a device"), (folder.path(), "a folder")] {
            let error = write_whole(path, b"text").unwrap_err();
            assert_eq!(error.source.kind(), ErrorKind::InvalidInput);
            assert!(error.to_string().contains(kind), "{error}");
        }
    }

    #[test]
    fn files_are_moved_where_each_has_a_place_and_else_none_is() {
        let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for name in ["a", "b"] {
            fs::write(from.path().join(name), name).unwrap();
        }
        fs::create_dir(from.path().join("c")).unwrap();
        for taken in ["a", "b"] {
            fs::create_dir(to.path().join(taken)).unwrap();
            let error = move_contents(from.path(), to.path()).unwrap_err();
            assert_eq!(error.path, to.path().join(taken));
            fs::remove_dir(&error.path).unwrap();
        }
        fs::write(to.path().join("c"), "").unwrap();
        let error = move_contents(from.path(), to.path()).unwrap_err();
        assert!(error.to_string().contains("it is not a folder"), "{error}");
        assert_eq!(fs::read_dir(to.path()).unwrap().count(), 1);
        fs::remove_file(error.path).unwrap();
        move_contents(from.path(), to.path()).unwrap();
        assert_eq!(fs::read_dir(to.path()).unwrap().count(), 3);
        assert_eq!(fs::read_dir(from.path()).unwrap().count(), 0);
    }

    #[test]
    #[cfg(unix)]
    fn a_folder_that_is_missing_is_there_all_at_once() {
        let parent = tempfile::tempdir().unwrap();
        let [from, link] = ["from", "link"].map(|name| parent.path().join(name));
        std::os::unix::fs::symlink("real", &link).unwrap();
        fs::create_dir(&from).unwrap();
        fs::write(from.join("a"), "whole").unwrap();
        move_contents(&from, &link).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let moved = parent.path().join("real/a");
        assert_eq!(fs::read(moved).unwrap(), b"whole");
        assert!(!from.exists());
    }
}
