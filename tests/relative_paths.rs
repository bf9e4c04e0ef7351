//! Configurations copied to another folder and used from a third: what they name is built in.

use std::fs;

use crate::support::paths::configs;
use crate::support::{Scratch, text};

/// A folder with a copy of a configuration, `copy.toml`.
fn copy(configuration: &str) -> Scratch {
    let scratch = Scratch::new();
    fs::copy(configs().join(configuration), scratch.path("copy.toml")).unwrap();
    scratch
}

#[test]
fn commands_take_copies_of_configurations() {
    for (configuration, line) in [
        ("smoke/train-pendulum.toml", "train --config"),
        (
            "smoke/physics-prior-pendulum.toml",
            "experiment physics-prior --config",
        ),
        (
            "smoke/receding-horizon-pendulum.toml",
            "experiment receding-horizon --config",
        ),
        ("demo.toml", "simulate --plant"),
        ("plants/servo-real.toml", "simulate --plant"),
        (
            "tasks/pendulum.toml",
            "control --plant pendulum-real --model pendulum --task",
        ),
    ] {
        let (copy, empty) = (copy(configuration), Scratch::new());
        let [file, out] = ["copy.toml", "out"].map(|name| copy.path(name));
        let mut command = empty.command(line);
        let run = command.args([text(&file), "--out", text(&out)]).output();
        let run = run.unwrap();
        let errors = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{line}:\n{errors}");
        assert!(out.exists(), "{line} wrote nothing");
        assert_eq!(empty.count(), 0, "{line} left something where it was run");
    }
}
