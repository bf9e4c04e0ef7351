//! Every command that works in a folder works there alone, and checks for space and permission before it starts.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Output};

use residyn_io::runs::RunFolder;

use crate::support::bench::{RIGS, bench};
use crate::support::exported_models::exported;
use crate::support::{Scratch, copy_files, says, words};

/// The commands that work in the folder of `--out`, run in [`input`].
const COMMANDS: [&str; 11] = [
    "closeloop --verbose",
    "train --config $REPO/configs/smoke/train-pendulum.toml",
    "tune --config $REPO/configs/smoke/tune-pendulum.toml --checkpoint $REPO/checkpoints/pendulum-sim",
    "sweep --seeds 2 --config $REPO/configs/smoke/train-pendulum.toml",
    "mbrl --config $REPO/configs/smoke/physics-prior-pendulum.toml",
    "experiment physics-prior --config $REPO/configs/smoke/physics-prior-pendulum.toml",
    "bench effects --grid $REPO/configs/bench/smoke.toml",
    "bench rigs --data . --rigs rigs.toml",
    "import --file model.json",
    "control --checkpoint $REPO/checkpoints/pendulum-sim --plant pendulum-real --task pendulum",
    "merge part",
];

/// A folder with a file of rigs, their logs, and an exported model.
fn input() -> Scratch {
    let scratch = bench(RIGS);
    copy_files(exported(), scratch.folder());
    scratch
}

#[test]
fn one_at_a_time_works_in_a_folder() {
    let scratch = input();
    let there = scratch.count();
    let folder = RunFolder::open(&scratch.path("out")).unwrap();
    let process = format!("process {},", std::process::id());
    for command in COMMANDS {
        let message = scratch.refuses(&format!("{command} --out out"));
        says(
            &message,
            &["out", &process, "is working there", "with --out"],
        );
    }
    drop(folder);
    assert_eq!(scratch.count(), there);
}

#[test]
fn a_full_disk_is_told_before_the_work() {
    let scratch = input();
    let there = scratch.count();
    for command in COMMANDS.into_iter().chain(["simulate --plant pendulum"]) {
        // No file of more than a kilobyte can be written, as on a full disk.
        let output = Command::new("bash")
            .args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\""])
            .arg(env!("CARGO_BIN_EXE_residyn"))
            .args(words(&format!("{command} --out out")))
            .current_dir(scratch.folder())
            .output()
            .unwrap();
        // Only the error, which names the folder.
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        let error = "error: out: cannot be written: ";
        assert!(message.starts_with(error), "{message}");
        says(&message, &["give another folder with --out"]);
        assert_eq!(scratch.count(), there, "{command} left something");
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
