//! The real binary and its output.

use std::path::Path;
use std::process::{Child, Command, Output};
use std::thread::sleep;
use std::time::Duration;

/// Run the program and return what it printed and its exit status.
pub fn residyn(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_residyn"))
        .args(arguments)
        .output()
        .expect("the binary runs")
}

/// Run the program in this many kB of virtual memory.
#[cfg(unix)]
pub fn residyn_within(memory_kb: u64, arguments: &[&str]) -> Output {
    within(memory_kb).args(arguments).output().unwrap()
}

/// The program in this many kB of virtual memory.
#[cfg(unix)]
pub fn within(memory_kb: u64) -> Command {
    let mut command = Command::new("bash");
    command
        .args(["-c", "ulimit -v \"$0\"; exec \"$@\""])
        .arg(memory_kb.to_string())
        .arg(env!("CARGO_BIN_EXE_residyn"))
        // The threads' own shares of virtual memory depend on the machine.
        .envs([("MALLOC_ARENA_MAX", "1"), ("RAYON_NUM_THREADS", "2")]);
    command
}

/// Run the program, which must succeed, and return its standard output.
#[track_caller]
pub fn succeeds(arguments: &[&str]) -> String {
    printed(&residyn(arguments), &[0], arguments)
}

/// Run the program, which must end with an answer, yes or no, and return its standard output.
#[track_caller]
pub fn answers(arguments: &[&str]) -> String {
    printed(&residyn(arguments), &[0, 1], arguments)
}

/// Run the program, which must fail with exit status 2, and return its message.
#[track_caller]
pub fn refuses(arguments: &[&str]) -> String {
    refusal(&residyn(arguments), arguments)
}

/// The standard output of a run that must end with one of these exit statuses.
#[track_caller]
pub fn printed(output: &Output, statuses: &[i32], arguments: &[&str]) -> String {
    said(output, statuses, arguments);
    String::from_utf8(output.stdout.clone()).expect("output is UTF-8")
}

/// The errors of a run that must end with one of these exit statuses.
#[track_caller]
pub fn said(output: &Output, statuses: &[i32], arguments: &[&str]) -> String {
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    let is_one = |status| statuses.contains(&status);
    assert!(
        output.status.code().is_some_and(is_one),
        "{arguments:?}: {}\n{errors}",
        output.status
    );
    errors
}

/// The message of a run that must be refused.
#[track_caller]
pub fn refusal(output: &Output, arguments: &[&str]) -> String {
    let message = said(output, &[2], arguments);
    assert!(output.stdout.is_empty(), "{arguments:?} printed a result");
    message
}

/// The message must contain each part.
#[track_caller]
pub fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{part:?} is missing in:\n{message}");
    }
}

/// Wait until a run, which must not end earlier, has made a file.
pub fn until_there(path: &Path, run: &mut Child) {
    while !path.exists() {
        assert!(run.try_wait().unwrap().is_none(), "the run has ended");
        sleep(Duration::from_millis(2));
    }
}

/// A path as text.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("scratch paths are UTF-8")
}
