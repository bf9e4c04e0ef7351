//! What Ctrl-C leaves of a run, and what it says.

#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::support::{Scratch, says, until_there};

fn begin(scratch: &Scratch, line: &str) -> Child {
    let mut command = scratch.command(line);
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::piped());
    quiet.spawn().unwrap()
}

/// Send Ctrl-C; return the run's output. The exit status must be that of an interrupted program.
fn interrupt(run: Child) -> String {
    // The lock of its folder precedes the handler by some microseconds.
    sleep(Duration::from_millis(200));
    let pid = run.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(sent.success());
    let output = run.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    said
}

#[test]
fn a_training_says_what_is_kept_and_how_to_go_on() {
    let scratch = Scratch::new();
    scratch.changed(
        "smoke/train-pendulum.toml",
        "epochs = 200",
        "epochs = 100000000",
    );
    let line = "train --config train-pendulum.toml --out out --save-every 20";
    let mut run = begin(&scratch, line);
    until_there(&scratch.path("out/model.toml"), &mut run);
    let said = interrupt(run);
    says(&said, &["interrupted: out has ", " of 100000000 epochs; "]);
    let typed = said.lines().last().unwrap().trim();
    assert_eq!(typed, format!("residyn {line}"));
    assert_eq!(scratch.count(), 2, "recipe and checkpoint are left");
    // The same command continues from what was kept.
    let mut again = begin(&scratch, line);
    let mut said = String::new();
    let mut errors = BufReader::new(again.stderr.take().unwrap());
    errors.read_line(&mut said).unwrap();
    again.kill().unwrap();
    again.wait().unwrap();
    says(&said, &["resumes from epoch "]);
}

#[test]
fn closing_the_loop_says_that_nothing_was_written() {
    let scratch = Scratch::new();
    let mut run = begin(&scratch, "closeloop --out report");
    until_there(&scratch.path(".report.lock"), &mut run);
    assert_eq!(interrupt(run), "interrupted: nothing was written\n");
    assert_eq!(scratch.count(), 0);
}

#[test]
fn a_run_that_counts_says_how_far_it_came() {
    let scratch = Scratch::new();
    let config = "$REPO/configs/physics-prior/acrobot-paper.toml";
    let mut run = begin(&scratch, &format!("mbrl --config {config} --out run"));
    until_there(&scratch.path("run/run.json"), &mut run);
    let said = interrupt(run);
    says(
        &said,
        &[" rounds; to resume from there, run again\n  residyn mbrl"],
    );
    assert!(!scratch.has(".run.lock"));
}
