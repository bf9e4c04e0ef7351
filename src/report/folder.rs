use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::json::{CHECKPOINT, MODEL, PLOTS, Report, TEXT};
use super::plot::PlotError;
use super::{model_file, picture, text};
use crate::closeloop::{LearnError, Outcome};
use crate::model::{Origin, System};

/// Why results could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    #[error("{path} cannot be written: {source}; free some space or give another folder with --out", path = .path.display())]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error(transparent)]
    Plot(#[from] PlotError),
    #[error(transparent)]
    Checkpoint(#[from] LearnError),
}

/// Write a file whole or not at all: under a temporary name beside it, then renamed.
///
/// # Errors
/// A folder that does not exist or cannot be written, or a full disk; nothing is left behind.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), WriteError> {
    let failed = |source| WriteError::File {
        path: path.to_owned(),
        source,
    };
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let missing = std::io::Error::new(ErrorKind::NotFound, "its folder does not exist");
        return Err(failed(missing));
    }
    let mut file = readable_by_all().tempfile_in(folder).map_err(failed)?;
    file.write_all(contents).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Temporary files are private by default; results have the permissions of any new file.
fn readable_by_all() -> tempfile::Builder<'static, 'static> {
    #[cfg_attr(not(unix), allow(unused_mut))]
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

/// Write report.json, report.md, model.toml, the plots and the checkpoint into `folder`, and return the report.
/// All is written into a folder beside it first, then moved file by file: a failure leaves `folder` as it was.
///
/// # Errors
/// An unwritable folder or a full disk.
pub fn write(
    folder: &Path,
    system: &System,
    outcome: &Outcome,
    origin: &Origin,
) -> Result<Report, WriteError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| WriteError::File { path, source }
    };
    let parent = folder
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    std::fs::create_dir_all(parent).map_err(failed(parent))?;
    let staging = tempfile::TempDir::new_in(parent).map_err(failed(folder))?;
    let report = Report::new(outcome, origin.seed);
    let put =
        |name: &str, contents: &str| write_whole(&staging.path().join(name), contents.as_bytes());
    let json =
        serde_json::to_string_pretty(&report).expect("a report has only finite numbers and texts");
    put("report.json", &(json + "\n"))?;
    put(MODEL, &model_file(system, outcome))?;
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
            model_toml: model_file(system, outcome),
            ..origin.clone()
        };
        learned.save(&staging.path().join(CHECKPOINT), &origin)?;
    }
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    for entry in std::fs::read_dir(staging.path()).map_err(failed(folder))? {
        let from = entry.map_err(failed(folder))?.path();
        let to = folder.join(from.file_name().expect("a file in a folder has a name"));
        if to.is_dir() {
            std::fs::remove_dir_all(&to).map_err(failed(&to))?;
        }
        std::fs::rename(&from, &to).map_err(failed(&to))?;
    }
    Ok(report)
}
