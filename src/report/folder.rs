use std::path::Path;

use thiserror::Error;

use super::json::{CHECKPOINT, MODEL, PLOTS, TEXT};
use super::plot::PlotError;
use super::schema::Report;
use super::{model_file, picture, text};
use crate::closeloop::{LearnError, Outcome};
use crate::files::{OutputError, folder_of, move_to, write_whole};
use crate::model::Origin;

/// Why results could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    #[error("{0}")]
    File(#[from] OutputError),
    #[error(transparent)]
    Plot(#[from] PlotError),
    #[error(transparent)]
    Checkpoint(#[from] LearnError),
}

/// Write report.json, report.md, model.toml, the plots and the checkpoint into `folder`, and return the report.
/// All is written into a folder beside it first, then moved file by file: a failure leaves `folder` as it was.
///
/// # Errors
/// An unwritable folder or a full disk.
pub fn write(
    folder: impl AsRef<Path>,
    outcome: &Outcome,
    origin: &Origin,
) -> Result<Report, WriteError> {
    let folder = folder.as_ref();
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| OutputError { path, source }
    };
    let parent = folder_of(folder);
    std::fs::create_dir_all(parent).map_err(failed(parent))?;
    let staging = tempfile::TempDir::new_in(parent).map_err(failed(folder))?;
    let report = Report::new(outcome, origin.seed);
    let put =
        |name: &str, contents: &str| write_whole(&staging.path().join(name), contents.as_bytes());
    let json =
        serde_json::to_string_pretty(&report).expect("a report has only finite numbers and texts");
    put("report.json", &(json + "\n"))?;
    put(MODEL, &model_file(outcome))?;
    put(TEXT, &text(outcome, origin.seed))?;
    let pictures = [
        picture::predictions(outcome)?,
        picture::residual(outcome)?,
        picture::errors(outcome)?,
    ];
    for (name, picture) in PLOTS.iter().zip(&pictures) {
        put(name, picture)?;
    }
    if let Some(learned) = &outcome.learned {
        let origin = Origin {
            model_toml: model_file(outcome),
            ..origin.clone()
        };
        learned.save(&staging.path().join(CHECKPOINT), &origin)?;
    }
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    for entry in std::fs::read_dir(staging.path()).map_err(failed(folder))? {
        let from = entry.map_err(failed(folder))?.path();
        let to = folder.join(from.file_name().expect("a file in a folder has a name"));
        if from.is_dir() {
            if to.is_dir() {
                std::fs::remove_dir_all(&to).map_err(failed(&to))?;
            }
            std::fs::rename(&from, &to).map_err(failed(&to))?;
        } else {
            move_to(&from, &to)?;
        }
    }
    Ok(report)
}
