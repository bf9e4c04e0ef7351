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
    // The threads' own shares of virtual memory depend on the machine.
    Command::new("bash")
        .args(["-c", "ulimit -v \"$0\"; exec \"$@\""])
        .arg(memory_kb.to_string())
        .arg(env!("CARGO_BIN_EXE_residyn"))
        .args(arguments)
        .env("MALLOC_ARENA_MAX", "1")
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .expect("the binary runs")
}

/// Run the program, which must succeed, and return its standard output.
pub fn succeeds(arguments: &[&str]) -> String {
    let output = residyn(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?} failed:\n{errors}");
    String::from_utf8(output.stdout).expect("output is UTF-8")
}

/// Run the program, which must end with an answer, yes or no, and return its standard output.
pub fn answers(arguments: &[&str]) -> String {
    let output = residyn(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    let status = output.status.code();
    assert!(matches!(status, Some(0 | 1)), "{arguments:?}:\n{errors}");
    String::from_utf8(output.stdout).expect("output is UTF-8")
}

/// Run the program, which must fail with exit status 2, and return its message.
pub fn refuses(arguments: &[&str]) -> String {
    let output = residyn(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}:\n{errors}");
    assert!(output.stdout.is_empty(), "{arguments:?} printed a result");
    errors
}

/// The message must contain each part.
#[track_caller]
pub fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "{part:?} is missing in:\n{message}");
    }
}

/// The error 0.5 s ahead of the first joint on a log, as `residyn evaluate` gives it for `--model FILE` or
/// `--checkpoint DIR`.
pub fn evaluated(model: &[&str], log: &str) -> f64 {
    let all = [&["evaluate", "--json", "--test", log], model].concat();
    let value: serde_json::Value = serde_json::from_str(&succeeds(&all)).unwrap();
    value["position_rmse"][1][0].as_f64().unwrap()
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

/// The output of a program that ran without reaching an answer.
pub fn ends_without(arguments: &[&str]) -> String {
    let output = residyn(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}:\n{message}");
    message
}
