//! What Ctrl-C leaves of a run, and what it says.

#![cfg(unix)]

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::support::{text, until_there};

fn begin(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_residyn"))
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Send Ctrl-C; return the exit status and the run's output.
fn interrupt(run: Child) -> (Option<i32>, String) {
    // The lock of its folder precedes the handler by some microseconds.
    sleep(Duration::from_millis(200));
    let pid = run.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(sent.success());
    let output = run.wait_with_output().unwrap();
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// A recipe of this many epochs.
fn recipe(folder: &Path, epochs: &str) -> String {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let recipe = fs::read_to_string(configs.join("smoke/train-pendulum.toml")).unwrap();
    let line = recipe
        .lines()
        .find(|line| line.starts_with("epochs"))
        .unwrap();
    let file = folder.join("recipe.toml");
    fs::write(&file, recipe.replace(line, &format!("epochs = {epochs}"))).unwrap();
    text(&file).to_owned()
}

#[test]
fn a_training_says_what_is_kept_and_how_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let recipe = recipe(folder.path(), "100000000");
    let command = [
        "train",
        "--config",
        &recipe,
        "--out",
        text(&out),
        "--save-every",
        "20",
    ];
    let mut run = begin(&command);
    until_there(&out.join("model.toml"), &mut run);
    let (status, said) = interrupt(run);
    assert_eq!(status, Some(130), "{said}");
    assert!(
        said.contains(&format!("interrupted: {} has ", text(&out))),
        "{said}"
    );
    assert!(said.contains(" of 100000000 epochs; "), "{said}");
    let typed = said.lines().last().unwrap().trim();
    assert_eq!(typed, format!("residyn {}", command.join(" ")));
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 2, "recipe and checkpoint: {left:?}");
    // The same command continues from what was kept.
    let mut again = begin(&command);
    let mut said = String::new();
    let mut errors = BufReader::new(again.stderr.take().unwrap());
    errors.read_line(&mut said).unwrap();
    again.kill().unwrap();
    again.wait().unwrap();
    assert!(said.contains("resumes from epoch "), "{said}");
}

#[test]
fn closing_the_loop_says_that_nothing_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let mut run = begin(&["closeloop", "--out", text(&out)]);
    until_there(&folder.path().join(".report.lock"), &mut run);
    let (status, said) = interrupt(run);
    assert_eq!(status, Some(130), "{said}");
    assert_eq!(said, "interrupted: nothing was written\n");
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_run_that_counts_says_how_far_it_came() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let config =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/physics-prior/acrobot-paper.toml");
    let command = ["mbrl", "--config", text(&config), "--out", text(&out)];
    let mut run = begin(&command);
    until_there(&out.join("run.json"), &mut run);
    let (status, said) = interrupt(run);
    assert_eq!(status, Some(130), "{said}");
    assert!(
        said.contains(" rounds; to resume from there, run again\n  residyn mbrl"),
        "{said}"
    );
    assert!(!folder.path().join(".run.lock").exists());
}
