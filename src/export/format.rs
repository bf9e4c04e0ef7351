use std::path::{Path, PathBuf};

use thiserror::Error;

use super::{Answers, FORMATS, Portable, PythonClient, Samples};
use crate::expr::suggestion;
use crate::model::NetworkError;
use crate::report::{WriteError, write_whole};

/// A format that models are written in.
#[derive(Debug)]
pub struct Format {
    pub name: &'static str,
    /// What is written, in a few words.
    pub about: &'static str,
    /// What of a model the format cannot carry, and what stands in its place; known before anything is written.
    pub limits: fn(&Portable) -> Vec<String>,
    /// The files for an output path, in memory.
    pub files: fn(&Portable, &Path) -> Result<Vec<File>, ExportError>,
    pub reader: Reader,
    /// How far at most its reader is from the program's own prediction, relative to the largest magnitude of each state.
    pub tolerance: f64,
}

/// A file that is to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    pub path: PathBuf,
    pub bytes: Vec<u8>,
    /// What it holds, in a few words.
    pub about: String,
}

/// Who can be asked what a written model predicts.
#[derive(Debug)]
pub enum Reader {
    /// A program of the format's own world.
    Python(PythonClient),
    /// This program, from the file alone.
    Own(fn(&Path, &Samples) -> Result<Answers, Unread>),
    /// Nobody: the reason.
    None(&'static str),
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unread {
    /// What would have to be installed.
    #[error("{0}")]
    NoReader(String),
    /// What the reader said of the file.
    #[error("{0}")]
    Refused(String),
}

/// Why a model cannot be exported.
#[derive(Debug, Error)]
pub enum ExportError {
    #[error("a model of `{system}` cannot be written as {format}: {reason}")]
    Model {
        format: &'static str,
        system: String,
        reason: String,
    },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Hybrid(#[from] NetworkError),
}

/// The format of this name.
///
/// # Errors
/// Unknown name, with the nearest known one.
pub fn find(name: &str) -> Result<&'static Format, String> {
    let known = || FORMATS.iter().map(|format| format.name);
    let format = FORMATS.iter().find(|format| format.name == name);
    format.copied().ok_or_else(|| {
        let near = suggestion(name, known());
        let all: Vec<&str> = known().collect();
        format!(
            "unknown format `{name}`{near}; there are {}",
            all.join(", ")
        )
    })
}

impl Format {
    /// Write the model: all files are made first, then each appears whole or not at all.
    ///
    /// # Errors
    /// A model that the format cannot carry, or a folder that cannot be written.
    pub fn write(&self, model: &Portable, path: &Path) -> Result<Vec<File>, ExportError> {
        let files = (self.files)(model, path)?;
        for file in &files {
            write_whole(&file.path, &file.bytes)?;
        }
        Ok(files)
    }

    /// What the format's reader predicts from a written file.
    ///
    /// # Errors
    /// No reader at hand, or one that refuses the file.
    pub fn ask(&self, path: &Path, samples: &Samples) -> Result<Answers, Unread> {
        match &self.reader {
            Reader::Python(client) => client.ask(path, samples),
            Reader::Own(ask) => ask(path, samples),
            Reader::None(reason) => Err(Unread::NoReader((*reason).to_owned())),
        }
    }
}
