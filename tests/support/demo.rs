//! The report of the demo rig.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use tempfile::TempDir;

/// The folder that `residyn closeloop` writes for the demo rig; made once for all tests of this file.
pub fn demo() -> &'static Path {
    static FOLDER: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, report) = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let report = folder.path().join("report");
        let run = Command::new(env!("CARGO_BIN_EXE_residyn"))
            .args([
                "closeloop",
                "--against",
                "pendulum",
                "--calibrate",
                "1",
                "--out",
            ])
            .arg(&report)
            .output()
            .expect("the program starts");
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(0), "closeloop failed: {said}");
        (folder, report)
    });
    report
}
