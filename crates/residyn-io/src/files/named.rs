use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

use super::read_text;

/// `file` as the file at `path` names it: relative to the folder that `path` is in.
pub fn beside(path: &Path, file: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(file)
}

/// `file` as the file at `path` names it or, if that is a plain name and no such file exists, the name itself, for
/// something built in. A path never depends on the folder in which the program is run.
pub fn beside_or_named(path: &Path, file: &Path) -> PathBuf {
    let beside = beside(path, file);
    let is_plain = file.extension().is_none() && file.components().count() == 1;
    if is_plain && !beside.is_file() {
        file.to_owned()
    } else {
        beside
    }
}

/// The text of the file at `path` or, if there is no file, the embedded text of that name.
///
/// # Errors
/// Neither exists, or the file cannot be read.
pub fn text_or_embedded(
    path: &Path,
    embedded: impl FnOnce(&str) -> Option<&'static str>,
) -> io::Result<Cow<'static, str>> {
    if !path.is_file()
        && let Some(text) = path.to_str().and_then(embedded)
    {
        return Ok(Cow::Borrowed(text));
    }
    read_text(path).map(Cow::Owned)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::{beside_or_named, text_or_embedded};

    #[test]
    fn a_file_comes_before_the_name_of_something_built_in() {
        let folder = tempfile::tempdir().unwrap();
        let (recipe, name) = (folder.path().join("recipe.toml"), Path::new("pendulum"));
        let embedded = |name: &str| (name == "pendulum").then_some("embedded");
        let text = || text_or_embedded(&beside_or_named(&recipe, name), embedded).unwrap();
        assert_eq!(text(), "embedded");
        // A folder of that name is not the file that is meant.
        let own = folder.path().join(name);
        fs::create_dir(&own).unwrap();
        assert_eq!(text(), "embedded");
        fs::remove_dir(&own).unwrap();
        fs::write(&own, "own").unwrap();
        assert_eq!(text(), "own");
        assert!(text_or_embedded(&folder.path().join("none"), embedded).is_err());
    }

    #[test]
    fn what_is_missing_is_missed_beside_the_file_that_names_it() {
        for file in ["own.toml", "../plants/own"] {
            let named = beside_or_named(Path::new("elsewhere/recipe.toml"), Path::new(file));
            assert_eq!(named, Path::new("elsewhere").join(file));
        }
    }
}
