//! Runs and their files, through the binary: one run per folder, recorded commands that reproduce the result, output
//! files that are written through links and never onto devices.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::support::in_folder::{json, refused, residyn, run};
use crate::support::paths::config;
use crate::support::{refuses, succeeds, text, until_there};

#[test]
fn a_second_run_in_a_folder_is_refused_and_harms_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let config = config("train-pendulum.toml");
    let save_often = ["--save-every", "20", "--out", "c"];
    let command = [&["train", "--config", &config][..], &save_often].concat();
    let mut first = residyn(dir, &[&command[..], &["--json"]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    until_there(&dir.join("c/checkpoint.json"), &mut first);
    for again in [&command[..], &["closeloop", "--out", "./c"]] {
        let message = refused(dir, again);
        let expected = format!(
            "c: another run, process {}, is working there; wait until",
            first.id()
        );
        assert!(message.contains(&expected), "{message}");
        assert!(message.contains("--out"), "{message}");
    }
    let ended = first.wait_with_output().unwrap();
    assert!(ended.status.success());
    let found: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(json(dir, &command), found);
    let left = fs::read_dir(dir).unwrap().count();
    assert_eq!(left, 1, "only the checkpoint is left");
}

/// Run a command, remove its output, run the command that `command` finds in the file `record`, and compare the records
/// without the keys in `clock`.
fn comes_again(arguments: &[&str], record: &str, command: fn(&Value) -> &Value, clock: &[&str]) {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let read = || -> Value {
        let text = fs::read_to_string(dir.join(record)).unwrap();
        let mut value: Value = serde_json::from_str(&text).unwrap();
        for key in clock {
            assert_ne!(value[*key].take(), Value::Null, "{key}");
        }
        value
    };
    assert!(run(dir, arguments).status.success(), "{arguments:?}");
    let first = read();
    fs::remove_dir_all(dir.join("the run")).unwrap();
    let bin = Path::new(env!("CARGO_BIN_EXE_residyn")).parent().unwrap();
    let again = Command::new("/bin/sh")
        .current_dir(dir)
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
    let experiment = config("smoke/physics-prior-pendulum.toml");
    let arguments = ["experiment", "physics-prior", "--config", &experiment];
    let own = ["--out", "the run", "--seed", "1000"];
    let recorded: fn(&Value) -> &Value = |results| {
        assert_eq!(results["seeds"], serde_json::json!([1000, 1001]));
        &results["command"]
    };
    comes_again(
        &[&arguments[..], &own].concat(),
        "the run/results.json",
        recorded,
        &["wall_s"],
    );
    let recipe = config("smoke/train-pendulum.toml");
    comes_again(
        &[&["train", "--config", &recipe][..], &own].concat(),
        "the run/checkpoint.json",
        |checkpoint| &checkpoint["config"]["command_line"],
        &[],
    );
    comes_again(
        &[&["sweep", "--seeds", "2", "--config", &recipe][..], &own].concat(),
        "the run/sweep.json",
        |sweep| &sweep["config"]["command_line"],
        &["totals"],
    );
}

#[test]
#[cfg(unix)]
fn a_log_is_written_through_a_link_and_never_onto_a_device() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("logs")).unwrap();
    symlink("logs/run.csv", at("link.csv")).unwrap();
    symlink("/dev/null", at("device.csv")).unwrap();
    let (link, device) = (at("link.csv"), at("device.csv"));
    let simulate = [
        "simulate",
        "--plant",
        "pendulum",
        "--duration",
        "1",
        "--out",
    ];
    succeeds(&[&simulate[..], &[text(&link)]].concat());
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(
        fs::read_to_string(at("logs/run.csv"))
            .unwrap()
            .starts_with("time,q1")
    );
    let message = refuses(&[&simulate[..], &[text(&device)]].concat());
    for part in ["device.csv", "a device", "not a regular file", "--out"] {
        assert!(message.contains(part), "{part:?} in {message}");
    }
    assert!(fs::symlink_metadata(&device).unwrap().is_symlink());
    assert_eq!(fs::read_dir(at("logs")).unwrap().count(), 1);
}

#[test]
#[cfg(unix)]
fn a_checkpoint_is_written_through_a_link() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::os::unix::fs::symlink("real", dir.join("link")).unwrap();
    let config = config("smoke/train-pendulum.toml");
    for _ in 0..2 {
        json(dir, &["train", "--config", &config, "--out", "link"]);
        assert!(fs::symlink_metadata(dir.join("link")).unwrap().is_symlink());
        assert!(dir.join("real/checkpoint.json").is_file());
        assert_eq!(fs::read_dir(dir).unwrap().count(), 2);
    }
}

mod slow {
    use super::*;

    #[test]
    fn a_report_is_written_where_all_its_files_have_a_place_and_else_none_is() {
        let folder = tempfile::tempdir().unwrap();
        // The files of a folder are read in any order, so each name is tried.
        for taken in ["report.json", "model.toml", "errors.svg"] {
            let out = folder.path().join(taken);
            fs::create_dir_all(out.join(taken)).unwrap();
            let message = refuses(&["closeloop", "--out", text(&out)]);
            for part in [taken, "it is a folder", "--out"] {
                assert!(message.contains(part), "{part:?} in {message}");
            }
            assert_eq!(fs::read_dir(&out).unwrap().count(), 1, "{taken}");
        }
    }
}
