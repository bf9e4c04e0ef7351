//! Runs and their files, through the binary: one run per folder, recorded commands that reproduce the result, output
//! files that are written through links and never onto devices.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::support::{Scratch, says, until_there};

const SHORT: &str = "--config $REPO/configs/smoke/train-pendulum.toml";

#[test]
fn a_second_run_in_a_folder_is_refused_and_harms_nothing() {
    let scratch = Scratch::new();
    let line = "train --config $REPO/configs/train-pendulum.toml --save-every 20 --out c";
    let mut first = scratch
        .command(&format!("{line} --json"))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    until_there(&scratch.path("c/checkpoint.json"), &mut first);
    let working = format!(
        "c: another run, process {}, is working there; wait until",
        first.id()
    );
    for again in [line, "closeloop --out ./c"] {
        says(&scratch.refuses(again), &[&working, "--out"]);
    }
    let ended = first.wait_with_output().unwrap();
    assert!(ended.status.success());
    let found: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(scratch.json(line), found);
    assert_eq!(scratch.count(), 1, "only the checkpoint is left");
}

/// Run a command, remove its output, run the command that `command` finds in the file `record`, and compare the records
/// without the keys in `clock`.
fn comes_again(line: &str, record: &str, command: fn(&Value) -> &Value, clock: &[&str]) {
    let scratch = Scratch::new();
    let read = || -> Value {
        let mut value = scratch.read_json(record);
        for key in clock {
            assert_ne!(value[*key].take(), Value::Null, "{key}");
        }
        value
    };
    let own = ["--out", "the run", "--seed", "1000"];
    let first = scratch.command(line).args(own).output().unwrap();
    assert!(first.status.success(), "{line}");
    let first = read();
    fs::remove_dir_all(scratch.path("the run")).unwrap();
    let bin = Path::new(env!("CARGO_BIN_EXE_residyn")).parent().unwrap();
    let again = Command::new("/bin/sh")
        .current_dir(scratch.folder())
        .args(["-c", command(&first).as_str().unwrap()])
        .env("PATH", bin)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&again.stderr);
    assert!(again.status.success(), "{}: {errors}", command(&first));
    assert_eq!(read(), first);
}

#[test]
#[cfg(unix)]
fn a_recorded_command_gives_the_same_file_again() {
    comes_again(
        "experiment physics-prior --config $REPO/configs/smoke/physics-prior-pendulum.toml",
        "the run/results.json",
        |results| {
            assert_eq!(results["seeds"], serde_json::json!([1000, 1001]));
            &results["command"]
        },
        &["wall_s"],
    );
    comes_again(
        &format!("train {SHORT}"),
        "the run/checkpoint.json",
        |checkpoint| &checkpoint["config"]["command_line"],
        &[],
    );
    comes_again(
        &format!("sweep --seeds 2 {SHORT}"),
        "the run/sweep.json",
        |sweep| &sweep["config"]["command_line"],
        &["totals"],
    );
}

#[test]
#[cfg(unix)]
fn a_log_is_written_through_a_link_and_never_onto_a_device() {
    use std::os::unix::fs::symlink;
    let scratch = Scratch::new();
    fs::create_dir(scratch.path("logs")).unwrap();
    symlink("logs/run.csv", scratch.path("link.csv")).unwrap();
    symlink("/dev/null", scratch.path("device.csv")).unwrap();
    let is_link = |name: &str| {
        let found = fs::symlink_metadata(scratch.path(name));
        found.unwrap().is_symlink()
    };
    scratch.succeeds("simulate --plant pendulum --duration 1 --out link.csv");
    assert!(is_link("link.csv"));
    assert!(scratch.read("logs/run.csv").starts_with("time,q1"));
    let message = scratch.refuses("simulate --plant pendulum --duration 1 --out device.csv");
    says(
        &message,
        &["device.csv", "a device", "not a regular file", "--out"],
    );
    assert!(is_link("device.csv"));
    assert_eq!(fs::read_dir(scratch.path("logs")).unwrap().count(), 1);
}

#[test]
#[cfg(unix)]
fn a_checkpoint_is_written_through_a_link() {
    let scratch = Scratch::new();
    let link = scratch.path("link");
    std::os::unix::fs::symlink("real", &link).unwrap();
    for _ in 0..2 {
        scratch.succeeds(&format!("train {SHORT} --out link"));
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(scratch.path("real/checkpoint.json").is_file());
        assert_eq!(scratch.count(), 2);
    }
}

mod slow {
    use super::*;

    #[test]
    fn a_report_is_written_where_all_its_files_have_a_place_and_else_none_is() {
        let scratch = Scratch::new();
        // The files of a folder are read in any order, so each name is tried.
        for taken in ["report.json", "model.toml", "errors.svg"] {
            let out = scratch.path(taken);
            fs::create_dir_all(out.join(taken)).unwrap();
            let message = scratch.refuses(&format!("closeloop --out {taken}"));
            says(&message, &[taken, "it is a folder", "--out"]);
            assert_eq!(fs::read_dir(&out).unwrap().count(), 1, "{taken}");
        }
    }
}
