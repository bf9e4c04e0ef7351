//! The real binary in its own working folder.

use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

use super::binary::{printed, refusal};
use super::until_there;

fn residyn(dir: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_residyn"));
    command.current_dir(dir).args(arguments);
    command
}

/// The JSON of a run that must succeed.
pub fn json(dir: &Path, arguments: &[&str]) -> Value {
    let all = [arguments, &["--json"]].concat();
    let output = residyn(dir, &all).output().unwrap();
    serde_json::from_str(&printed(&output, &[0], arguments)).unwrap()
}

/// The message of a run that must be refused.
pub fn refused(dir: &Path, arguments: &[&str]) -> String {
    refusal(&residyn(dir, arguments).output().unwrap(), arguments)
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
