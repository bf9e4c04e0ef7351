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
