//! Real clients read what the program writes: Python with the packages of `tests/clients`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use residyn::report::EventFile;
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

/// Run one of the scripts in `tests/clients`; without an interpreter, print a prominent note.
pub fn client(script: &str, arguments: &[&Path]) {
    let Some(python) = std::env::var_os("RESIDYN_PYTHON") else {
        let note = format!("SKIPPED {script}: RESIDYN_PYTHON is not set; run tests/run\n");
        // Not eprintln!, which the test harness swallows.
        let _ = std::io::stderr().write_all(note.as_bytes());
        return;
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = Command::new(python)
        .arg(root.join("tests/clients").join(script))
        .args(arguments)
        .output()
        .expect("RESIDYN_PYTHON names an interpreter");
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{script} failed:\n{said}");
}

/// The published schema of report.json.
pub fn schema_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/report.schema.json")
}

#[test]
fn python_reads_the_weights_of_a_checkpoint() {
    client("weights.py", &[demo()]);
}

#[test]
fn report_matches_its_published_schema() {
    client("report.py", &[demo(), &schema_path()]);
}

#[test]
fn tensorboard_reads_event_files() {
    let scalars = [
        ("loss/training", 0, 1_700_000_000.25, 0.0),
        ("loss/training", 1, 1_700_000_001.5, 1.25e-7),
        ("loss/training", 5_000_000_000, 1_700_000_002.0, -3.5),
        ("Rückgabe", 7, 1_700_000_003.0, f64::from(f32::MAX)),
    ];
    let folder = tempfile::tempdir().unwrap();
    let events = folder.path().join("runs/first");
    let mut file = EventFile::create(&events, 1_700_000_000.0).unwrap();
    for (tag, step, wall_time_s, value) in scalars {
        file.scalar(tag, step, wall_time_s, value).unwrap();
    }
    let expected = folder.path().join("expected.json");
    std::fs::write(&expected, serde_json::to_string(&scalars).unwrap()).unwrap();
    client("events.py", &[&events, &expected]);
}
