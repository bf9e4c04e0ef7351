//! The real binary in its own working folder.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

use super::until_there;

pub fn residyn(dir: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_residyn"));
    command.current_dir(dir).args(arguments);
    command
}

pub fn run(dir: &Path, arguments: &[&str]) -> Output {
    residyn(dir, arguments).output().unwrap()
}

/// The JSON of a run that must succeed.
pub fn json(dir: &Path, arguments: &[&str]) -> Value {
    let output = run(dir, &[arguments, &["--json"]].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The message of a run that must be refused.
pub fn refused(dir: &Path, arguments: &[&str]) -> String {
    let output = run(dir, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// Start the command, and kill it this long after a file appears.
pub fn kill_after(command: &mut Command, file: &Path, later: Duration) {
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = quiet.spawn().unwrap();
    until_there(file, &mut child);
    sleep(later);
    child.kill().unwrap();
    let status = child.wait().unwrap();
    assert_eq!(status.code(), None, "it was over before it was killed");
}
