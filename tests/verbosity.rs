//! How much the program says, and where: `--quiet`, `--verbose`, colours, pipes that close.

use std::process::{Command, Output, Stdio};

use crate::support::{residyn, succeeds, text};

/// A log with a joint at rest, which is a serious finding.
fn still() -> tempfile::NamedTempFile {
    let log = tempfile::Builder::new().suffix(".csv").tempfile().unwrap();
    let rows = (0..300).map(|row| format!("{},0.5,0,{}\n", f64::from(row) * 0.01, row % 7));
    let rows: String = rows.collect();
    std::fs::write(log.path(), format!("time,q1,qd1,tau1\n{rows}")).unwrap();
    log
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn a_quiet_run_prints_the_headline_alone() {
    let log = still();
    let output = residyn(&["audit", "--quiet", text(log.path())]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stdout).unwrap();
    let name = log.path().file_name().unwrap().to_str().unwrap();
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with(&format!("{name}: ")), "{said}");
    assert!(said.contains(" serious, "), "{said}");
    // The flag's place does not matter, and the flag does not change what a program reads.
    assert_eq!(
        succeeds(&["-q", "check", "pendulum"]),
        "pendulum: 0 finding(s)\n"
    );
    let plain = succeeds(&["check", "--json", "pendulum"]);
    assert_eq!(succeeds(&["check", "-q", "--json", "pendulum"]), plain);
    let refused = residyn(&["-q", "check", "nothing.toml"]);
    assert!(errors(&refused).starts_with("error: nothing.toml"));
}

#[test]
fn a_verbose_run_says_how_long_its_stages_took() {
    let log = still();
    let output = residyn(&["audit", "-v", text(log.path())]);
    let said = errors(&output);
    let is_stage = |line: &str| line.ends_with(" s  reading the logs");
    assert!(said.lines().any(is_stage), "{said}");
    let plain = residyn(&["audit", text(log.path())]);
    assert_eq!(plain.stdout, output.stdout);
    assert_eq!(errors(&plain), "");
}

#[test]
fn colours_are_for_terminals_alone() {
    let log = still();
    let run = |set: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_residyn"));
        command.args(["audit", text(log.path())]);
        command.envs(set.iter().copied()).output().unwrap().stdout
    };
    let plain = run(&[]);
    assert!(!plain.contains(&0x1b), "this is no terminal");
    assert!(run(&[("CLICOLOR_FORCE", "1")]).contains(&0x1b));
    assert_eq!(run(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]), plain);
}

#[test]
fn a_pipe_that_closes_ends_the_program_quietly() {
    let mut program = Command::new(env!("CARGO_BIN_EXE_residyn"))
        .args(["list", "effects"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(program.stdout.take());
    let output = program.wait_with_output().unwrap();
    assert!(output.status.success());
    assert_eq!(errors(&output), "");
}
