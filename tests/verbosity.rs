//! How much the program says, and where: `--quiet`, `--verbose`, colours, pipes that close.

use std::process::{Output, Stdio};

use crate::support::Scratch;

/// A folder with `still.csv`, a log with a joint at rest, which is a serious finding.
fn still() -> Scratch {
    let scratch = Scratch::new();
    scratch.log("still.csv", |time| {
        [0.5, 0.0, (100.0 * time).rem_euclid(7.0)]
    });
    scratch
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn a_quiet_run_prints_the_headline_alone() {
    let scratch = still();
    let output = scratch.run("audit --quiet still.csv");
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("still.csv: "), "{said}");
    assert!(said.contains(" serious, "), "{said}");
    // The flag's place does not matter, and the flag does not change what a program reads.
    let said = scratch.succeeds("-q check pendulum");
    assert_eq!(said, "pendulum: 0 finding(s)\n");
    let plain = scratch.succeeds("check --json pendulum");
    assert_eq!(scratch.succeeds("check -q --json pendulum"), plain);
    let refused = scratch.refuses("-q check nothing.toml");
    assert!(refused.starts_with("error: nothing.toml"));
}

#[test]
fn a_verbose_run_says_how_long_its_stages_took() {
    let scratch = still();
    let output = scratch.run("audit -v still.csv");
    let said = errors(&output);
    let is_stage = |line: &str| line.ends_with(" s  reading the logs");
    assert!(said.lines().any(is_stage), "{said}");
    let plain = scratch.run("audit still.csv");
    assert_eq!(plain.stdout, output.stdout);
    assert_eq!(errors(&plain), "");
}

#[test]
fn colours_are_for_terminals_alone() {
    let scratch = still();
    let run = |set: &[(&str, &str)]| {
        let mut command = scratch.command("audit still.csv");
        command.envs(set.iter().copied()).output().unwrap().stdout
    };
    let plain = run(&[]);
    assert!(!plain.contains(&0x1b), "this is no terminal");
    assert!(run(&[("CLICOLOR_FORCE", "1")]).contains(&0x1b));
    assert_eq!(run(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]), plain);
}

#[test]
fn a_pipe_that_closes_ends_the_program_quietly() {
    let scratch = Scratch::new();
    let mut program = scratch
        .command("list effects")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(program.stdout.take());
    let output = program.wait_with_output().unwrap();
    assert!(output.status.success());
    assert_eq!(errors(&output), "");
}
