//! Every command that works in a folder works there alone, and checks for space and permission before it starts.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use residyn_io::runs::RunFolder;

use crate::support::bench::{RIGS, bench};
use crate::support::exported_models::exported;
use crate::support::paths::config;
use crate::support::{Scratch, refuses, says, text};

/// The commands that work in the folder of `--out`.
fn commands() -> Vec<Vec<String>> {
    let [recipe, tuning, experiment, grid] = [
        "smoke/train-pendulum.toml",
        "smoke/tune-pendulum.toml",
        "smoke/physics-prior-pendulum.toml",
        "bench/smoke.toml",
    ]
    .map(config);
    let prior = config("../checkpoints/pendulum-sim");
    let checkpoint = ["--checkpoint", &prior];
    let config = ["--config", &experiment];
    let plant = ["--plant", "pendulum-real", "--task", "pendulum"];
    let exported = exported().join("model.json");
    let rigs = measured_rigs();
    let [data, file] = [rigs.path(""), rigs.path("rigs.toml")];
    let rigs = ["--data", text(&data), "--rigs", text(&file)];
    let all: [&[&[&str]]; 11] = [
        &[&["closeloop", "--verbose"]],
        &[&["train", "--config", &recipe]],
        &[&["tune", "--config", &tuning], &checkpoint],
        &[&["sweep", "--seeds", "2", "--config", &recipe]],
        &[&["mbrl"], &config],
        &[&["experiment", "physics-prior"], &config],
        &[&["bench", "effects", "--grid", &grid]],
        &[&["bench", "rigs"], &rigs],
        &[&["import", "--file", text(&exported)]],
        &[&["control"], &checkpoint, &plant],
        &[&["merge", "part"]],
    ];
    let owned = |words: &[&[&str]]| words.concat().into_iter().map(str::to_owned).collect();
    all.into_iter().map(owned).collect()
}

/// A file of rigs, and their logs.
fn measured_rigs() -> &'static Scratch {
    static RIGS_AND_LOGS: OnceLock<Scratch> = OnceLock::new();
    RIGS_AND_LOGS.get_or_init(|| bench(RIGS))
}

fn with_out<'a>(command: &'a [String], out: &'a str) -> Vec<&'a str> {
    let words = command.iter().map(String::as_str);
    words.chain(["--out", out]).collect()
}

#[test]
fn one_at_a_time_works_in_a_folder() {
    let scratch = tempfile::tempdir().unwrap();
    let out = scratch.path().join("out");
    let folder = RunFolder::open(&out).unwrap();
    let process = format!("process {},", std::process::id());
    for command in commands() {
        let message = refuses(&with_out(&command, text(&out)));
        says(
            &message,
            &[text(&out), &process, "is working there", "with --out"],
        );
    }
    drop(folder);
    assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0);
}

/// The program's output when it cannot write a file of more than a kilobyte, as on a full disk.
fn on_a_full_disk(arguments: &[&str]) -> Output {
    Command::new("bash")
        .args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_residyn"))
        .args(arguments)
        .output()
        .unwrap()
}

/// Only the error, which names the folder.
fn is_told(output: &Output, out: &str) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    let error = format!("error: {out}: cannot be written: ");
    assert!(message.starts_with(&error), "{message}");
    says(&message, &["give another folder with --out"]);
}

#[test]
fn a_full_disk_is_told_before_the_work() {
    let scratch = tempfile::tempdir().unwrap();
    let out = scratch.path().join("out");
    let simulate = ["simulate", "--plant", "pendulum"].map(str::to_owned);
    for command in commands().into_iter().chain([simulate.to_vec()]) {
        let output = on_a_full_disk(&with_out(&command, text(&out)));
        is_told(&output, text(&out));
        assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0);
    }
}

/// A run without superuser rights, since the superuser may write everywhere.
fn without_rights(scratch: &Path, arguments: &[&str]) -> Output {
    let program = scratch.join("residyn");
    if !program.exists() {
        // In a separate process: a file that a child of another thread still holds open for writing cannot be started.
        let mut copy = Command::new("cp");
        let copied = copy.arg(env!("CARGO_BIN_EXE_residyn")).arg(&program);
        assert!(copied.status().unwrap().success());
    }
    let mut command = Command::new(program);
    if fs::metadata(scratch).unwrap().uid() == 0 {
        const NOBODY: u32 = 65534;
        command.uid(NOBODY);
    }
    command
        .args(arguments)
        .current_dir(scratch)
        .output()
        .unwrap()
}

#[test]
fn a_folder_without_permission_is_told_before_the_work() {
    let scratch = tempfile::tempdir().unwrap();
    let scratch = scratch.path();
    let allow = |path: &Path, mode| {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    };
    allow(scratch, 0o755);
    for name in ["mine", "open", "open/out"] {
        fs::create_dir(scratch.join(name)).unwrap();
    }
    allow(&scratch.join("mine"), 0o555);
    allow(&scratch.join("open/out"), 0o555);
    allow(&scratch.join("open"), 0o777);
    let simulate = &["simulate", "--plant", "pendulum"][..];
    let closeloop = &["closeloop", "--verbose"];
    for (command, out, refusal) in [
        (simulate, "mine/log.csv", "mine/log.csv: cannot be written"),
        (closeloop, "mine/out", "mine/out cannot be locked"),
        (closeloop, "mine/in/out", "mine/in cannot be made"),
        (closeloop, "open/out", "open/out: cannot be written"),
    ] {
        let output = without_rights(scratch, &[command, &["--out", out]].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            message.starts_with(&format!("error: {refusal}: ")),
            "{message}"
        );
        says(&message, &["ermission denied", "--out"]);
        assert_eq!(fs::read_dir(scratch.join("mine")).unwrap().count(), 0);
        assert_eq!(fs::read_dir(scratch.join("open")).unwrap().count(), 1);
    }
    allow(&scratch.join("mine"), 0o755);
}
