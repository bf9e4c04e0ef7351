//! What is known of one log alone: a file beside it, `run1.csv.toml` beside `run1.csv`, gives values of the model's parameters
//! there, and so do single numbers of a recording that have the names of parameters.

use std::path::{Path, PathBuf};

use residyn_core::data::Log;
use residyn_core::model::{FileError, Model};

use crate::files::read_text;

/// The model with what is known of each of these logs alone, as tables `[logs."run1.csv"]` of its file.
///
/// # Errors
/// A file beside a log that cannot be read, or gives anything but possible values of parameters; recorded values that
/// their parameters cannot have; values for one of several logs of the same name.
pub fn with_values_of<'l>(
    model: &Model,
    logs: impl IntoIterator<Item = &'l Log>,
) -> Result<Model, FileError> {
    let logs: Vec<&Log> = logs.into_iter().collect();
    let mut known = model.clone();
    for log in &logs {
        let tables = known.configurations.len();
        known = with_values_of_log(&known, log)?;
        let is_other = |other: &&Log| other.name() == log.name() && other.path != log.path;
        if known.configurations.len() > tables
            && let Some(other) = logs.iter().copied().find(is_other)
        {
            let message = format!(
                "has values of its own and the file name of {}; rename one",
                other.path.display()
            );
            return Err(FileError::new(&log.path, None, message));
        }
    }
    Ok(known)
}

fn with_values_of_log(model: &Model, log: &Log) -> Result<Model, FileError> {
    let model = model.with_recorded_values(log);
    let model = model.map_err(|why| FileError::new(&log.path, None, why))?;
    let beside = beside(&log.path);
    if !beside.is_file() {
        return Ok(model);
    }
    let unreadable = |why| FileError::new(&beside, None, format!("cannot be read: {why}"));
    let text = read_text(&beside).map_err(unreadable)?;
    model.with_values_beside(log, &beside, &text)
}

/// The file that gives values in a log.
fn beside(log: &Path) -> PathBuf {
    let mut path = log.as_os_str().to_owned();
    path.push(".toml");
    path.into()
}
