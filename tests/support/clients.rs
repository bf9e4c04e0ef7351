//! Other programs that read what Residyn writes. A test whose program is missing says so loudly, and passes.

use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use super::paths::ours;

/// Tests of `tests/run --quick` need no other programs.
pub fn not_in_a_quick_run() {
    assert!(
        std::env::var_os("RESIDYN_QUICK").is_none(),
        "a test that needs another program stands in a module `slow`: see tests/tests.rs"
    );
}

/// The interpreter of the scripts in `tests/clients`; without one, a prominent note says that this one is skipped.
pub fn interpreter_for(script: &str) -> Option<OsString> {
    let python = std::env::var_os("RESIDYN_PYTHON");
    if python.is_none() {
        let note = format!("SKIPPED {script}: RESIDYN_PYTHON is not set; run tests/run\n");
        // Not eprintln!, which the test harness swallows.
        let _ = std::io::stderr().write_all(note.as_bytes());
    }
    python
}

/// The interpreter with `residyn.plants` from the sources, for plants of MuJoCo and Gymnasium; the variables of
/// its environment. `None` without an interpreter.
pub fn plants_in(folder: &Path) -> Option<[(&'static str, OsString); 2]> {
    let python = interpreter_for("plants in MuJoCo")?;
    // The package without its compiled part, which plants do not need.
    let package = folder.join("package/residyn");
    fs::create_dir_all(&package).unwrap();
    let plants = package.join("plants");
    if !plants.exists() {
        symlink(ours("python/residyn/plants"), plants).unwrap();
    }
    let programs = Path::new(&python).parent().unwrap();
    let path = std::env::var("PATH").unwrap();
    let path = format!("{}:{path}", programs.display());
    Some([
        ("PYTHONPATH", folder.join("package").into()),
        ("PATH", path.into()),
    ])
}

/// Run one of the scripts in `tests/clients`, if there is an interpreter.
pub fn client(script: &str, arguments: &[&Path]) {
    not_in_a_quick_run();
    let Some(python) = interpreter_for(script) else {
        return;
    };
    let run = Command::new(python)
        .arg(ours("tests/clients").join(script))
        .args(arguments)
        .output()
        .expect("RESIDYN_PYTHON names an interpreter");
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{script} failed:\n{said}");
}

/// Whether a browser is installed; if not, say so loudly. CI must have one.
fn has_browser() -> bool {
    let is_there =
        ["chromium", "chromedriver"].map(|name| Path::new("/usr/bin").join(name).exists());
    if is_there == [true; 2] {
        return true;
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "CI needs chromium and chromium-driver"
    );
    let note = "SKIPPED page.py: chromium and chromium-driver are not installed\n";
    // Not eprintln!, which the test harness swallows.
    let _ = std::io::stderr().write_all(note.as_bytes());
    false
}

/// Look at a page in a browser, if there is one.
pub fn look_at(page: &Path) {
    not_in_a_quick_run();
    if has_browser() {
        client("page.py", &[page]);
    }
}

/// Whether these tools start; if one does not, print a prominent note.
pub fn there_are(tools: &[&str]) -> bool {
    not_in_a_quick_run();
    let starts = |tool: &&str| Command::new(tool).arg("--version").output().is_ok();
    let missing: Vec<&str> = tools.iter().copied().filter(|tool| !starts(tool)).collect();
    if !missing.is_empty() {
        let missing = missing.join(", ");
        // Not eprintln!, which the test harness swallows.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED a test of exported C: there is no {missing}"
        );
    }
    missing.is_empty()
}

/// Run a command, which must succeed.
pub fn succeeds(command: &mut Command, what: &str) {
    let run = command.output().unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{what}: {command:?}\n{said}");
}
