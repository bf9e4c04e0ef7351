use std::fs::OpenOptions;
use std::io::Write;

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
    /// The file of this name, which need not exist yet.
    pub fn new(folder: &RunFolder, name: &'static str) -> Self {
        Self {
            folder: folder.clone(),
            name,
        }
    }

    /// The results that are there. A truncated line, or one of another version, is none.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read<T: DeserializeOwned>(&self) -> Result<Vec<T>, RunFolderError> {
        let bytes = self.folder.bytes(self.name)?.unwrap_or_default();
        let lines = bytes.split(|byte| *byte == b'\n');
        Ok(lines
            .filter_map(|line| serde_json::from_slice(line).ok())
            .collect())
    }

    /// Add a result; the folder is made where it is missing.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(&self, result: &impl Serialize) -> Result<(), RunFolderError> {
        self.folder.make()?;
        let path = self.folder.path().join(self.name);
        let json = serde_json::to_string(result).expect("numbers, texts and names");
        let opened = OpenOptions::new().create(true).append(true).open(&path);
        // Begin with a line break too: the line before may be truncated.
        let written = opened.and_then(|mut file| file.write_all(format!("\n{json}\n").as_bytes()));
        Ok(written.map_err(OutputError::of(&path))?)
    }
}
