use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;
use thiserror::Error;

use super::Identity;
use super::lock;
use crate::files::{OutputError, check_room, end_of_links, folder_of, hidden_beside, write_whole};

/// What a folder belongs to: the identity of its run and the version that began it.
const RECORD: &str = "run.json";

/// The folder of a run: one run at a time works in it, and a run that was interrupted goes on in it.
///
/// It is locked until all copies are dropped or the process ends for any reason. The lock is a file next to the folder,
/// `.NAME.lock`, since a checkpoint replaces the whole folder.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
    lock: Arc<NamedTempFile>,
}

/// Why a run cannot have its folder.
#[derive(Debug, Error)]
pub enum RunFolderError {
    #[error("{path}: {process} is working there", path = .path.display(), process = named(*.process))]
    Busy { path: PathBuf, process: Option<u32> },
    #[error("{path} holds another run: {difference}", path = .path.display())]
    OtherRun { path: PathBuf, difference: String },
    #[error("{path} is a file", path = .path.display())]
    NotAFolder { path: PathBuf },
    #[error("{path} cannot be {action}: {source}", path = .path.display())]
    Io {
        action: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    #[error("{path} is damaged: {reason}", path = .path.display())]
    Damaged { path: PathBuf, reason: String },
    #[error("{0}")]
    Output(#[from] OutputError),
}

/// `run.json`
#[derive(Serialize, Deserialize)]
struct Record {
    /// The program that began the run.
    residyn: String,
    #[serde(flatten)]
    run: Identity,
}

impl RunFolder {
    /// Lock the folder `path`. It need not exist yet; its parent folder is made.
    ///
    /// # Errors
    /// Another run works there, `path` is a file, or there is no room or no permission to write in it.
    pub fn open(path: &Path) -> Result<Self, RunFolderError> {
        let folder = Self::lock(path)?;
        check_room(path)?;
        Ok(folder)
    }

    fn lock(path: &Path) -> Result<Self, RunFolderError> {
        let owned = || path.to_owned();
        if path.exists() && !path.is_dir() {
            return Err(RunFolderError::NotAFolder { path: owned() });
        }
        let parent = folder_of(path);
        fs::create_dir_all(parent).map_err(failed("made", parent))?;
        let file = lock_of(path).map_err(failed("found", path))?;
        match lock::take(&file) {
            Ok(lock) => Ok(Self {
                path: owned(),
                lock: Arc::new(lock),
            }),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Err(RunFolderError::Busy {
                path: owned(),
                process: lock::owner(&file),
            }),
            Err(source) => Err(failed("locked", path)(source)),
        }
    }

    /// The folder of this name within this one, under the same lock.
    #[must_use]
    pub fn within(&self, name: impl AsRef<Path>) -> Self {
        Self {
            path: self.path.join(name),
            lock: Arc::clone(&self.lock),
        }
    }

    /// The folder's path, as it was given; it may not exist yet.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Remove the lock, for a process that ends at once and drops nothing.
    pub fn leave(&self) {
        // A file that stays is not locked once its owner has ended, and the next one takes it.
        let _ = fs::remove_file(self.lock.path());
    }

    /// Make the folder if it is missing.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn make(&self) -> Result<(), RunFolderError> {
        fs::create_dir_all(&self.path).map_err(failed("made", &self.path))
    }

    /// Record that the folder belongs to `run`, or check that it does.
    ///
    /// # Errors
    /// The folder belongs to another run, cannot be made or written, or its record is damaged.
    pub fn claim(&self, run: &Identity) -> Result<(), RunFolderError> {
        match self.read::<Record>(RECORD)? {
            Some(saved) => self.expect(&saved.run, run),
            None => self.write(
                RECORD,
                &Record {
                    residyn: env!("CARGO_PKG_VERSION").to_owned(),
                    run: run.clone(),
                },
            ),
        }
    }

    /// Refuse to mix `run` with the one that was `saved` here.
    ///
    /// # Errors
    /// They differ.
    pub fn expect(&self, saved: &Identity, run: &Identity) -> Result<(), RunFolderError> {
        self.refuse(run.difference(saved))
    }

    /// Refuse a run that differs from the one here.
    pub(super) fn refuse(&self, difference: Option<String>) -> Result<(), RunFolderError> {
        difference.map_or(Ok(()), |difference| {
            Err(RunFolderError::OtherRun {
                path: self.path.clone(),
                difference,
            })
        })
    }

    /// The text of a file here; `None` if there is no such file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn text(&self, name: &str) -> Result<Option<String>, RunFolderError> {
        self.reading(name, |path| fs::read_to_string(path))
    }

    /// The bytes of a file here; `None` if there is no such file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn bytes(&self, name: &str) -> Result<Option<Vec<u8>>, RunFolderError> {
        self.reading(name, |path| fs::read(path))
    }

    fn reading<T>(
        &self,
        name: &str,
        read: impl FnOnce(&Path) -> io::Result<T>,
    ) -> Result<Option<T>, RunFolderError> {
        let path = self.path.join(name);
        match read(&path) {
            Ok(contents) => Ok(Some(contents)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed("read", &path)(error)),
        }
    }

    /// The value in a JSON file here; `None` if there is no such file.
    ///
    /// # Errors
    /// A file that cannot be read or does not hold a `T`.
    pub fn read<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, RunFolderError> {
        let read = |text: String| serde_json::from_str(&text);
        let value = self.text(name)?.map(read).transpose();
        value.map_err(|error| self.damaged(name, error.to_string()))
    }

    /// Write a JSON file here, whole or not at all; the folder is made if it is missing.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, name: &str, value: &impl Serialize) -> Result<(), RunFolderError> {
        let json = serde_json::to_string_pretty(value).expect("numbers, texts and names");
        self.write_text(name, &(json + "\n"))
    }

    /// Write a text file here, whole or not at all; the folder is made if it is missing.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write_text(&self, name: &str, text: &str) -> Result<(), RunFolderError> {
        self.make()?;
        Ok(write_whole(&self.path.join(name), text.as_bytes())?)
    }

    /// The error for a file here that this program cannot have written.
    pub fn damaged(&self, name: &str, reason: String) -> RunFolderError {
        RunFolderError::Damaged {
            path: self.path.join(name),
            reason,
        }
    }
}

/// A running process, in words.
fn named(process: Option<u32>) -> String {
    process.map_or_else(
        || "another run".to_owned(),
        |process| format!("another run, process {process},"),
    )
}

/// The file that locks a folder: the same for every name that leads to the folder.
fn lock_of(path: &Path) -> io::Result<PathBuf> {
    let path = end_of_links(path);
    let real = match fs::canonicalize(&path) {
        Ok(real) => real,
        Err(_) => fs::canonicalize(folder_of(&path))?.join(path.file_name().unwrap_or_default()),
    };
    Ok(hidden_beside(&real, ".lock"))
}

fn failed(action: &'static str, path: &Path) -> impl Fn(io::Error) -> RunFolderError {
    move |source| RunFolderError::Io {
        action,
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;

    use super::{Identity, RunFolder, RunFolderError};

    #[test]
    fn one_run_at_a_time_works_in_a_folder() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let first = RunFolder::open(&path).unwrap();
        assert!(!path.exists(), "a folder is made when it is needed");
        let part = first.within("runs/a");
        part.write_text("a.txt", "").unwrap();
        drop(first);
        let refused = RunFolder::open(&path).unwrap_err();
        assert!(matches!(refused, RunFolderError::Busy { .. }), "{refused}");
        // Under another name it is the same folder.
        let refused = RunFolder::open(&path.join("../run")).unwrap_err();
        assert!(matches!(refused, RunFolderError::Busy { .. }), "{refused}");
        drop(part);
        drop(RunFolder::open(&path).unwrap());
        let left: Vec<_> = fs::read_dir(parent.path()).unwrap().collect();
        assert_eq!(left.len(), 1, "the lock goes with its owner: {left:?}");
        // A killed process leaves the file, but not the lock.
        fs::write(parent.path().join(".run.lock"), "").unwrap();
        drop(RunFolder::open(&path).unwrap());
    }

    #[test]
    fn threads_that_open_and_drop_a_folder_never_share_it() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let owners = std::sync::atomic::AtomicUsize::new(0);
        let work = || {
            for _ in 0..500 {
                if let Ok(folder) = RunFolder::lock(&path) {
                    use std::sync::atomic::Ordering::SeqCst;
                    assert_eq!(owners.fetch_add(1, SeqCst), 0);
                    owners.fetch_sub(1, SeqCst);
                    drop(folder);
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(work);
            }
        });
    }

    #[test]
    fn a_folder_keeps_to_its_run() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let of_seed = |seed| Identity {
            command: "train".to_owned(),
            seed,
            config: json!({"epochs": 40}),
            inputs: [].into(),
        };
        let claim = |seed| RunFolder::open(&path).unwrap().claim(&of_seed(seed));
        claim(3).unwrap();
        claim(3).unwrap();
        let message = claim(4).unwrap_err().to_string();
        assert!(
            message.ends_with("run holds another run: its `seed` is 3, here it is 4"),
            "{message}"
        );
        fs::write(path.join("run.json"), "{").unwrap();
        let message = claim(3).unwrap_err().to_string();
        assert!(message.contains("run.json is damaged: EOF"), "{message}");
    }

    #[test]
    fn a_file_is_no_folder() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let message = RunFolder::open(file.path()).unwrap_err().to_string();
        assert!(message.ends_with("is a file"), "{message}");
        let inside = RunFolder::open(&file.path().join("a/run")).unwrap_err();
        assert!(inside.to_string().contains("cannot be made"), "{inside}");
    }
}
