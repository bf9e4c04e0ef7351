use std::error::Error;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::json::{CHECKPOINT, MODEL, PAGE, PLOTS, RANGES, REPORT, TEXT};
use super::schema::{Report, SCHEMA};
use super::{model_file, page, picture, text};
use residyn_core::closeloop::{Outcome, Stage};
use residyn_core::model::Origin;
use residyn_io::files::{
    FreshFolder, OutputError, end_of_links, folder_of, move_contents, read_saved, write_whole,
};
use residyn_plot::PlotError;

/// Why results could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    #[error("{0}")]
    File(#[from] OutputError),
    #[error(transparent)]
    Plot(#[from] PlotError),
    #[error(transparent)]
    Network(Box<dyn Error + Send + Sync>),
}

impl WriteError {
    /// The error with the path in the folder that the file was to be moved to, since its temporary path is gone.
    fn of(self, staging: &Path, folder: &Path) -> Self {
        match self {
            Self::File(OutputError { path, source }) => Self::File(OutputError {
                path: path
                    .strip_prefix(staging)
                    .map_or_else(|_| path.clone(), |name| folder.join(name)),
                source,
            }),
            other => other,
        }
    }
}

/// Why the report of a folder could not be read.
#[derive(Debug, Error)]
pub enum ReadError {
    #[error("{}: {error}; give a folder that `residyn closeloop` wrote", path.display())]
    File {
        path: PathBuf,
        error: std::io::Error,
    },
    #[error(
        "{}: it has schema {found}, and this version of the program reads schema {SCHEMA}; make the report again with the command in \
         its `configuration`",
        path.display()
    )]
    Version { path: PathBuf, found: u32 },
    #[error(
        "{}: {error}; if another version of the program wrote the report, make it again with the command in its `configuration`",
        path.display()
    )]
    Shape {
        path: PathBuf,
        error: serde_json::Error,
    },
    #[error(
        "{}: it contradicts itself: {fault}; make the report again with the command in its `configuration`",
        path.display()
    )]
    Contradiction { path: PathBuf, fault: String },
}

/// What every version of `report.json` has.
#[derive(Deserialize)]
struct Version {
    schema: u32,
}

impl Report {
    /// The report of a folder.
    ///
    /// # Errors
    /// A folder without report.json, or a report.json of another form or one that contradicts itself.
    pub fn read(folder: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = folder.as_ref().join(REPORT);
        let json = match read_saved(&path) {
            Ok(json) => json,
            Err(error) => return Err(ReadError::File { path, error }),
        };
        if let Ok(Version { schema: found }) = serde_json::from_slice(&json)
            && found != SCHEMA
        {
            return Err(ReadError::Version { path, found });
        }
        let report: Self = match serde_json::from_slice(&json) {
            Ok(report) => report,
            Err(error) => return Err(ReadError::Shape { path, error }),
        };
        match report.contradiction() {
            Some(fault) => Err(ReadError::Contradiction { path, fault }),
            None => Ok(report),
        }
    }

    /// Write report.html and report.md into a folder, and return their paths.
    ///
    /// # Errors
    /// A folder that cannot be written, or a full disk.
    pub fn write_readable(&self, folder: impl AsRef<Path>) -> Result<[PathBuf; 2], OutputError> {
        let [html, markdown] = [PAGE, TEXT].map(|name| folder.as_ref().join(name));
        write_whole(&html, page(self).as_bytes())?;
        write_whole(&markdown, text(self).as_bytes())?;
        Ok([html, markdown])
    }
}

/// Write report.json, report.html, report.md, model.toml, the plots and the checkpoint into `folder`, and return the report.
/// Everything is first written into a folder next to it and moved once every file has a destination: a failure leaves
/// `folder` as it was.
///
/// # Errors
/// A folder that cannot be written, a full disk, or a report file whose place is taken by something that is not a
/// regular file.
pub fn write(
    folder: impl AsRef<Path>,
    outcome: &Outcome,
    origin: &Origin,
) -> Result<Report, WriteError> {
    let folder = folder.as_ref();
    let parent = folder_of(folder);
    std::fs::create_dir_all(parent).map_err(OutputError::of(parent))?;
    let staging = FreshFolder::beside(&end_of_links(folder)).map_err(OutputError::of(folder))?;
    let report = Report::new(outcome, origin);
    put_all(staging.path(), &report, outcome, origin)
        .map_err(|error| error.of(staging.path(), folder))?;
    move_contents(staging.path(), folder)?;
    Ok(report)
}

/// Write the files of a report into an empty folder.
fn put_all(
    folder: &Path,
    report: &Report,
    outcome: &Outcome,
    origin: &Origin,
) -> Result<(), WriteError> {
    let put = |name: &str, contents: &str| write_whole(&folder.join(name), contents.as_bytes());
    put(REPORT, &json(report))?;
    put(RANGES, &json(&report.ranges))?;
    put(TIMINGS, &timings(outcome))?;
    put(MODEL, &model_file(outcome))?;
    report.write_readable(folder)?;
    let pictures = [
        picture::predictions(outcome)?,
        picture::residual(outcome)?,
        picture::errors(outcome)?,
    ];
    for (name, picture) in PLOTS.iter().zip(&pictures) {
        put(name, picture)?;
    }
    if let Some(network) = outcome.network() {
        let origin = Origin {
            model_toml: model_file(outcome),
            ..origin.clone()
        };
        let saved = network.save(&folder.join(CHECKPOINT), &origin);
        saved.map_err(|error| match error.downcast() {
            Ok(output) => WriteError::File(*output),
            Err(other) => WriteError::Network(other),
        })?;
    }
    Ok(())
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("a report has only finite numbers and texts") + "\n"
}

/// Kept apart from the report, which is the same each time.
const TIMINGS: &str = "timings.json";

/// How long each stage took.
fn timings(outcome: &Outcome) -> String {
    let entry = |(stage, seconds): &(Stage, f64)| serde_json::json!({ "stage": stage, "about": stage.text(), "seconds": seconds });
    json(&outcome.seconds.iter().map(entry).collect::<Vec<_>>())
}
