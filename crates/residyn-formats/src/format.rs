//! What a format is: a writer, a client that reads the written files, and, for robot descriptions, a reader.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::ExportModel;
use super::robot::edit::Edit;
use super::robot::write_back::{self, Change};
use super::verify::{Client, ClientError, Predictions, Samples};
use super::xml::{self, Source};
use residyn_core::data::Joint;
use residyn_core::limits::DELAY_STEPS;
use residyn_core::model::tree::{Tree, model_text};
use residyn_core::model::{
    CommandFilter, FileError, Library, Model, ModelError, NetworkError, ReadyDrive,
};
use residyn_io::files::{OutputError, write_whole};

/// A format of other programs.
#[derive(Debug)]
pub struct Format {
    pub name: &'static str,
    /// What is written, in a few words.
    pub about: &'static str,
    /// The usual extension of its files, without a dot.
    pub extension: &'static str,
    /// Parts of a model that the format cannot represent, and what replaces them.
    pub not_carried: fn(&ExportModel) -> Vec<String>,
    /// The files for an output path, in memory.
    pub files: fn(&ExportModel, &Path) -> Result<Vec<File>, ExportError>,
    /// Predicts from the written files.
    pub client: Client,
    /// The largest allowed difference between the client's predictions and the program's own, relative to the largest
    /// magnitude of each state.
    pub tolerance: f64,
    /// Reads robot descriptions, if that is what the format is for.
    pub robots: Option<RobotReader>,
}

/// Reads a tree of bodies from a robot description, and writes values into it.
#[derive(Debug)]
pub struct RobotReader {
    /// What can be read, in a few words.
    pub about: &'static str,
    /// The whole tree, or the branch that ends at the named body.
    pub read: fn(&Path, Option<&str>) -> Result<Tree, FileError>,
    /// The root element of its files.
    pub root: &'static str,
    /// The effects that its joints can hold.
    pub effects: &'static [&'static str],
    /// Writes changed numbers into a file.
    pub(crate) rewrite: Rewrite,
}

/// Adds the edits to a file that make these changes.
///
/// # Errors
/// A description that lacks what is to be changed, or values that no body can have.
pub(crate) type Rewrite = fn(&Source<'_>, &mut Edit<'_>, &[Change]) -> Result<(), FileError>;

impl RobotReader {
    /// The model of the tree, or of its branch that ends at the body `tip`, and notes on
    /// parts of the description that are read differently or not at all. `drive` names what drives the joints, if not
    /// torques.
    ///
    /// # Errors
    /// A description that cannot be read or is not a tree; an unknown drive.
    pub fn model(
        &self,
        file: &Path,
        tip: Option<&str>,
        drive: Option<&str>,
    ) -> Result<(Model, Vec<String>), FileError> {
        let tree = self.tree(file, tip, drive)?;
        Ok((model_of(&tree)?, tree.notes))
    }

    /// As [`RobotReader::model`], the tree.
    ///
    /// # Errors
    /// As there.
    pub fn tree(
        &self,
        file: &Path,
        tip: Option<&str>,
        drive: Option<&str>,
    ) -> Result<Tree, FileError> {
        let tree = (self.read)(file, tip)?;
        let Some(name) = drive else { return Ok(tree) };
        let found = ReadyDrive::find(Library::drives(), name);
        let found = found.map_err(|unknown| FileError::new(file, None, unknown.to_string()));
        Ok(tree.driven_by(found?))
    }
}

/// The reader of a robot description; `None` for a file that is not XML, or not a file.
///
/// # Errors
/// XML that is not a robot description.
pub fn robot_reader(file: &Path) -> Result<Option<&'static RobotReader>, FileError> {
    let text = xml::text(file).unwrap_or_default();
    let begin = text.trim_start_matches('\u{feff}').trim_start();
    if !begin.starts_with('<') {
        return Ok(None);
    }
    let source = Source::new(file, &text)?;
    Ok(write_back::format(&source)?.robots.as_ref())
}

/// The model of a tree.
///
/// # Errors
/// A tree whose values no model can have.
pub fn model_of(tree: &Tree) -> Result<Model, FileError> {
    let name = Path::new(&tree.name);
    Model::from_text(name, &model_text(tree), Library::built_in().effects())
}

/// A file to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    pub path: PathBuf,
    pub bytes: Vec<u8>,
    /// What it holds, in a few words.
    pub about: String,
}

/// Why a model cannot be exported.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    #[error("a model of `{system}` cannot be written as {format}: {reason}")]
    Model {
        format: &'static str,
        system: String,
        reason: String,
    },
    #[error(
        "a model of `{system}` cannot be written as {format}: the delay of joint {joint} is {delay_s:?} s, and at most \
         {DELAY_STEPS} steps of {step_s:?} s are remembered; give a longer step"
    )]
    Delay {
        format: &'static str,
        system: String,
        joint: Joint,
        delay_s: f64,
        step_s: f64,
    },
    #[error("{0}")]
    Write(#[from] OutputError),
    #[error(transparent)]
    Hybrid(#[from] NetworkError),
    #[error(transparent)]
    Measured(#[from] ModelError),
}

impl File {
    pub(super) fn new(path: &Path, bytes: impl Into<Vec<u8>>, about: impl Into<String>) -> Self {
        Self {
            path: path.to_owned(),
            bytes: bytes.into(),
            about: about.into(),
        }
    }
}

impl Format {
    /// Write the model. All files are made in memory first; then each appears whole or not at all.
    ///
    /// # Errors
    /// A model that the format cannot carry, such as any that reads further measured columns, or a folder that cannot be
    /// written.
    pub fn write(&self, model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
        model.check_measured()?;
        self.check_delays(model)?;
        let files = (self.files)(model, path)?;
        for file in &files {
            write_whole(&file.path, &file.bytes)?;
        }
        Ok(files)
    }

    /// Refuse delays of more steps than the written files remember commands for.
    fn check_delays(&self, model: &ExportModel) -> Result<(), ExportError> {
        let step_s = model.step_s;
        for joint in Joint::all(model.joints()) {
            let delay_s = model.filter(joint, CommandFilter::Delay).unwrap_or(0.0);
            if !(delay_s / step_s <= DELAY_STEPS as f64) {
                return Err(ExportError::Delay {
                    system: model.name().to_owned(),
                    format: self.name,
                    joint,
                    delay_s,
                    step_s,
                });
            }
        }
        Ok(())
    }

    /// What the format's client predicts from a written file.
    ///
    /// # Errors
    /// No client available, or one that fails on the file.
    pub fn predict(&self, path: &Path, samples: &Samples) -> Result<Predictions, ClientError> {
        self.client.predict(path, samples)
    }
}
