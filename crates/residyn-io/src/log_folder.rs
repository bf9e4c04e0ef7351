//! The logs in a folder.

use std::path::{Path, PathBuf};

use residyn_core::data::LogError;

use crate::files::listed;
use crate::table::{LOG_FORMATS, is_data_set};

/// Endings of files that make a folder one recording.
const RECORDED: [&str; 2] = ["db3", "mcap"];

/// The logs that these paths stand for. A folder stands for the files in it whose names end as those of logs do, and for
/// the folders in it that are one log, by name; a folder that is one log itself, a rosbag2 or a data set of LeRobot, and
/// any other path stand for themselves.
///
/// # Errors
/// A folder that cannot be read, or in which there is no log.
pub fn logs_in<P: AsRef<Path>>(
    paths: impl IntoIterator<Item = P>,
) -> Result<Vec<PathBuf>, LogError> {
    let each = paths.into_iter().map(|path| logs_at(path.as_ref()));
    Ok(each.collect::<Result<Vec<_>, _>>()?.concat())
}

fn logs_at(path: &Path) -> Result<Vec<PathBuf>, LogError> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let files = listed(path).map_err(LogError::open(path))?;
    if is_one_log(path, &files) {
        return Ok(vec![path.to_owned()]);
    }
    let logs: Vec<PathBuf> = files.into_iter().filter(|file| is_log(file)).collect();
    match logs.is_empty() {
        true => Err(LogError::form(path, without_logs())),
        false => Ok(logs),
    }
}

/// Whether a file or folder looks like a log from outside.
fn is_log(path: &Path) -> bool {
    match path.is_dir() {
        true => listed(path).is_ok_and(|files| is_one_log(path, &files)),
        false => ends_in(path, endings()),
    }
}

fn is_one_log(folder: &Path, files: &[PathBuf]) -> bool {
    is_data_set(folder) || files.iter().any(|file| ends_in(file, RECORDED))
}

fn endings() -> impl Iterator<Item = &'static str> {
    LOG_FORMATS
        .iter()
        .flat_map(|format| format.endings)
        .copied()
}

fn ends_in(path: &Path, endings: impl IntoIterator<Item = &'static str>) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    let name = name.unwrap_or_default().to_lowercase();
    let ends = |ending: &str| {
        name.strip_suffix(ending)
            .is_some_and(|stem| stem.ends_with('.'))
    };
    endings.into_iter().any(ends)
}

fn without_logs() -> String {
    let endings: Vec<String> = endings().map(|ending| format!(".{ending}")).collect();
    format!(
        "is a folder without logs: no file in it ends in {}; name a file",
        endings.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_folder_stands_for_its_logs_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in [
            "b.CSV",
            "a.pt",
            "c.csv.gz",
            "README.md",
            "arm.xml",
            "notes.txt",
        ] {
            fs::write(at(name), "").unwrap();
        }
        fs::create_dir(at("bag")).unwrap();
        fs::write(at("bag").join("bag_0.db3"), "").unwrap();
        fs::create_dir(at("plots")).unwrap();
        let found = logs_in([folder.path(), &at("bag"), &at("absent")]).unwrap();
        let wanted = ["a.pt", "b.CSV", "bag", "c.csv.gz", "bag", "absent"];
        assert_eq!(found, wanted.map(at));
        let refused = logs_in([at("plots")]).unwrap_err().to_string();
        assert!(
            refused.contains("plots: is a folder without logs"),
            "{refused}"
        );
    }
}
