use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{RunFolder, RunFolderError};
use crate::files::OutputError;

/// A file in the folder of a run to which a line of JSON is added for each result.
pub struct Lines {
    folder: RunFolder,
    name: &'static str,
}

impl Lines {
    /// The file of this name, which need not exist yet, and its results. A partial line left by a killed run is cut
    /// off; a line of another version is not a result.
    ///
    /// # Errors
    /// A file that cannot be read or truncated.
    pub fn open<T: DeserializeOwned>(
        folder: &RunFolder,
        name: &'static str,
    ) -> Result<(Self, Vec<T>), RunFolderError> {
        let file = Self {
            folder: folder.clone(),
            name,
        };
        let mut bytes = folder.bytes(name)?.unwrap_or_default();
        let whole = bytes.iter().rposition(|byte| *byte == b'\n');
        let whole = whole.map_or(0, |last| last + 1);
        if whole < bytes.len() {
            bytes.truncate(whole);
            file.cut(whole)?;
        }
        let lines = bytes.split(|byte| *byte == b'\n');
        let results = lines.filter_map(|line| serde_json::from_slice(line).ok());
        Ok((file, results.collect()))
    }

    /// Add a result, all of it or nothing; the folder is made if it is missing.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(&self, result: &impl Serialize) -> Result<(), RunFolderError> {
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
        let open = || Lines::open::<u32>(&folder, "a.jsonl").unwrap();
        let (lines, found) = open();
        assert!(found.is_empty());
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
            let (lines, results) = open();
            assert_eq!(results, found);
            assert_eq!(fs::read_to_string(&path).unwrap(), kept);
            lines.add(&4).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), format!("{kept}4\n"));
        }
    }
}
