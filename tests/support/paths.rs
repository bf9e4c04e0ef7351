//! Paths of the project's own files.

use std::path::{Path, PathBuf};

pub fn configs() -> PathBuf {
    ours("configs")
}

pub fn config(name: &str) -> String {
    configs().join(name).display().to_string()
}

/// The published schema of report.json.
pub fn schema_path() -> PathBuf {
    ours("docs/report.schema.json")
}

/// A file or folder of the repository.
pub fn ours(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The library's crates by their names, with their folders.
pub fn crates() -> Vec<(String, PathBuf)> {
    let folder = ours("crates");
    let names = std::fs::read_dir(&folder).unwrap().map(|entry| {
        let name = entry.unwrap().file_name();
        name.into_string().unwrap()
    });
    let rooms = names.map(|name| (name.clone(), folder.join(name)));
    let mut all: Vec<_> = rooms.collect();
    all.push(("residyn".to_owned(), ours("")));
    all.push(("residyn-validation".to_owned(), ours("validation")));
    all.sort();
    all
}
