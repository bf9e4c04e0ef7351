use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

/// `file` as the file at `path` names it: relative to the folder that `path` is in.
pub fn beside(path: &Path, file: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(file)
}

/// `file` as the file at `path` names it or, where there is no such file, the name as it is: that of something built in.
pub fn beside_or_named(path: &Path, file: &Path) -> PathBuf {
    let beside = beside(path, file);
    if beside.is_file() {
        beside
    } else {
        file.to_owned()
    }
}

/// The text of the file at `path` or, where there is no file, the embedded text of that name.
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
    std::fs::read_to_string(path).map(Cow::Owned)
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
}
