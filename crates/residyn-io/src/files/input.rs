use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use residyn_core::limits::{SAVED_BYTES, TEXT_BYTES};

/// The regular file that `path` leads to. Anything else, such as a pipe, may never begin or never end.
///
/// # Errors
/// A file that does not exist, cannot be opened or is not a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    let found = fs::metadata(path).map_err(|error| match path.to_str() {
        Some("-") => invalid(
            "standard input is not read, since files are read more than once; write it to a file",
        ),
        _ => error,
    })?;
    // Checked before opening, since opening a pipe waits for a writer.
    if !found.is_file() {
        return Err(invalid(&format!(
            "it is {}, not a regular file",
            kind(&found)
        )));
    }
    File::open(path)
}

/// The length of a regular file \[bytes\].
///
/// # Errors
/// As [`open`].
pub fn size(path: &Path) -> io::Result<u64> {
    Ok(open(path)?.metadata()?.len())
}

/// The text of a file that people write.
///
/// # Errors
/// As [`open`]; a file that is longer than [`TEXT_BYTES`] or not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    let bytes = read(path, TEXT_BYTES)?;
    String::from_utf8(bytes)
        .map_err(|error| io::Error::new(ErrorKind::InvalidData, error.utf8_error()))
}

/// The bytes of a file that the program wrote.
///
/// # Errors
/// As [`open`]; a file that is longer than [`SAVED_BYTES`].
pub fn read_saved(path: &Path) -> io::Result<Vec<u8>> {
    read(path, SAVED_BYTES)
}

fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(invalid(&format!("it has more than {} MB", most >> 20))),
        false => Ok(bytes),
    }
}

/// The files and folders in a folder, by name.
///
/// # Errors
/// A folder that cannot be read.
pub fn listed(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let paths = fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut paths: Vec<PathBuf> = paths.collect::<io::Result<_>>()?;
    paths.sort();
    Ok(paths)
}

/// The kind of a file that is not regular, with its article.
pub(super) fn kind(found: &Metadata) -> &'static str {
    match found.is_dir() {
        true => "a folder",
        false => "a device or a pipe",
    }
}

fn invalid(message: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, message)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{open, read, read_text};

    #[test]
    fn files_are_read_to_a_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "text").unwrap();
        assert_eq!(read_text(&path).unwrap(), "text");
        assert_eq!(read(&path, 4).unwrap(), b"text");
        let message = read(&path, 3).unwrap_err().to_string();
        assert_eq!(message, "it has more than 0 MB");
        fs::write(&path, [b'a', 0xff]).unwrap();
        assert!(read_text(&path).unwrap_err().to_string().contains("utf-8"));
        let message = open(folder.path()).unwrap_err().to_string();
        assert_eq!(message, "it is a folder, not a regular file");
        let message = open("-".as_ref()).unwrap_err().to_string();
        assert!(
            message.starts_with("standard input is not read"),
            "{message}"
        );
    }

    #[test]
    #[cfg(unix)]
    fn what_never_begins_or_never_ends_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let [pipe, device] = ["pipe", "device"].map(|name| folder.path().join(name));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        std::os::unix::fs::symlink("/dev/zero", &device).unwrap();
        for path in [pipe, device] {
            let message = read_text(&path).unwrap_err().to_string();
            assert_eq!(message, "it is a device or a pipe, not a regular file");
        }
    }
}
