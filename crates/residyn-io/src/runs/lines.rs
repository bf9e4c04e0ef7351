use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{RunFolder, RunFolderError};
use crate::files::OutputError;

/// Results by their keys, each a line of JSON in a file in the folder of a run.
pub struct Lines<R> {
    folder: RunFolder,
    name: &'static str,
    known: BTreeMap<String, R>,
}

impl<R: Serialize + DeserializeOwned> Lines<R> {
    /// The file of this name, which need not exist yet, and its results. A partial line left by a killed run is cut
    /// off; a line of another version is not a result.
    ///
    /// # Errors
    /// A file that cannot be read or truncated.
    pub fn open(
        folder: &RunFolder,
        name: &'static str,
        key: fn(&R) -> String,
    ) -> Result<Self, RunFolderError> {
        let bytes = folder.bytes(name)?.unwrap_or_default();
        let whole = bytes.iter().rposition(|byte| *byte == b'\n');
        let whole = whole.map_or(0, |last| last + 1);
        let lines = bytes[..whole].split(|byte| *byte == b'\n');
        let results = lines.filter_map(|line| serde_json::from_slice(line).ok());
        let file = Self {
            folder: folder.clone(),
            name,
            known: results.map(|result| (key(&result), result)).collect(),
        };
        if whole < bytes.len() {
            file.cut(whole)?;
        }
        Ok(file)
    }

    /// The result with this key, if there is one.
    pub fn find(&self, key: &str) -> Option<&R> {
        self.known.get(key)
    }

    /// The result with this key; if there is none, it is made now and added.
    ///
    /// # Errors
    /// As `make`, or a file that cannot be written.
    pub fn find_or_make<E: From<RunFolderError>>(
        &mut self,
        key: &str,
        make: impl FnOnce() -> Result<R, E>,
    ) -> Result<&R, E> {
        if !self.known.contains_key(key) {
            let made = make()?;
            self.add(&made)?;
            self.known.insert(key.to_owned(), made);
        }
        Ok(&self.known[key])
    }

    /// Add a result, all of it or nothing; the folder is made if it is missing.
    fn add(&self, result: &R) -> Result<(), RunFolderError> {
        self.folder.make()?;
        let path = self.path();
        let json = serde_json::to_string(result).expect("numbers, texts and names");
        Ok(append(&path, &(json + "\n")).map_err(OutputError::of(&path))?)
    }

    /// Remove the file, whose results are part of others now.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub fn remove(self) -> Result<(), RunFolderError> {
        let path = self.path();
        fs::remove_file(&path).map_err(|source| RunFolderError::Io {
            action: "removed",
            path,
            source,
        })
    }

    fn cut(&self, length: usize) -> Result<(), RunFolderError> {
        let path = self.path();
        let opened = OpenOptions::new().write(true).open(&path);
        let cut = opened.and_then(|file| file.set_len(length as u64));
        Ok(cut.map_err(OutputError::of(&path))?)
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join(self.name)
    }
}

fn append(path: &Path, line: &str) -> io::Result<()> {
    let mut file = OpenOptions::new().create(true).append(true).open(path)?;
    let before = file.metadata()?.len();
    // Some file systems report a full disk only when the data are written to it.
    let written = file.write_all(line.as_bytes());
    let written = written.and_then(|()| file.sync_data());
    if written.is_err() {
        // If this fails as well, the line is cut off when the file is opened again.
        let _ = file.set_len(before);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::{Lines, RunFolder, fs};

    #[test]
    fn what_is_left_of_a_line_is_cut_off() {
        let parent = tempfile::tempdir().unwrap();
        let folder = RunFolder::open(&parent.path().join("run")).unwrap();
        let open = || Lines::<u32>::open(&folder, "a.jsonl", u32::to_string).unwrap();
        let lines = open();
        assert!(lines.known.is_empty());
        lines.add(&1).unwrap();
        lines.add(&20).unwrap();
        let path = folder.path().join("a.jsonl");
        for (left, found, kept) in [
            ("1\n20\n3", vec![1, 20], "1\n20\n"),
            // A line of another version stays.
            ("1\n{}\n20\n", vec![1, 20], "1\n{}\n20\n"),
            ("2", vec![], ""),
        ] {
            fs::write(&path, left).unwrap();
            let lines = open();
            assert_eq!(lines.known.values().copied().collect::<Vec<_>>(), found);
            assert_eq!(fs::read_to_string(&path).unwrap(), kept);
            lines.add(&4).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), format!("{kept}4\n"));
        }
    }
}
