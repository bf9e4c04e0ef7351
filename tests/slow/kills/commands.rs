//! The long-running commands, with settings for a second or less.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::in_folder::json;
use crate::support::paths::config;

/// A command that works in the folder `out`.
pub struct Long {
    pub name: &'static str,
    pub arguments: Vec<String>,
    /// Makes the command's input.
    pub prepare: fn(&Path),
    /// The message with which it continues from existing files; `None` if it says nothing or no files exist.
    pub goes_on: fn(&Path) -> Option<String>,
}

fn long(name: &'static str, arguments: &[&str]) -> Long {
    let all = arguments.iter().chain(&["--out", "out"]);
    Long {
        name,
        arguments: all.map(|word| (*word).to_owned()).collect(),
        prepare: |_| (),
        goes_on: |_| None,
    }
}

pub fn train() -> Long {
    let recipe = config("smoke/train-pendulum.toml");
    Long {
        goes_on: epoch,
        ..long(
            "train",
            &["train", "--config", &recipe, "--save-every", "20"],
        )
    }
}

pub fn tune() -> Long {
    let recipe = config("smoke/tune-pendulum.toml");
    let arguments = [
        "tune",
        "--checkpoint",
        "prior",
        "--config",
        &recipe,
        "--save-every",
        "20",
    ];
    Long {
        prepare: |folder| {
            let recipe = config("smoke/train-pendulum.toml");
            json(folder, &["train", "--config", &recipe, "--out", "prior"]);
        },
        goes_on: epoch,
        ..long("tune", &arguments)
    }
}

pub fn sweep() -> Long {
    let recipe = config("smoke/train-pendulum.toml");
    long("sweep", &["sweep", "--config", &recipe, "--seeds", "4"])
}

pub fn mbrl() -> Long {
    let experiment = config("smoke/physics-prior-pendulum.toml");
    long("mbrl", &["mbrl", "--config", &experiment])
}

pub fn experiment() -> Long {
    let experiment = config("smoke/physics-prior-pendulum.toml");
    let arguments = ["experiment", "physics-prior", "--config", &experiment];
    long("experiment", &arguments)
}

pub fn bench() -> Long {
    Long {
        prepare: |folder| {
            let grid = fs::read_to_string(config("bench/smoke.toml")).unwrap();
            let short = grid.replace("logs = 3\nseconds = 8", "logs = 2\nseconds = 3");
            assert_ne!(short, grid);
            fs::write(folder.join("grid.toml"), short).unwrap();
        },
        ..long("bench", &["bench", "effects", "--grid", "grid.toml"])
    }
}

pub fn closeloop() -> Long {
    let arguments = [
        "closeloop",
        "--model",
        "pendulum",
        "--train",
        "run1.csv",
        "--test",
        "run2.csv",
        "--calibrate",
        "2",
    ];
    Long {
        prepare: |folder| {
            for (log, seed) in [("run1.csv", "1"), ("run2.csv", "2")] {
                let simulate = ["simulate", "--plant", "pendulum", "--duration", "5"];
                let friction = ["--effect", "coulomb_friction=0.3"];
                let own = ["--seed", seed, "--out", log];
                json(folder, &[&simulate[..], &friction, &own].concat());
            }
        },
        goes_on: |root| {
            let kept = fs::read_to_string(root.join("out/simulations.jsonl")).ok()?;
            let whole = kept.matches('\n').count();
            (whole > 0).then(|| format!("note: out has {whole} of "))
        },
        ..long("closeloop", &arguments)
    }
}

/// Training continues from the epoch of its checkpoint.
fn epoch(root: &Path) -> Option<String> {
    let places = ["out", ".out.previous"].map(|place| root.join(place).join("checkpoint.json"));
    let text = places.iter().find_map(|file| fs::read(file).ok())?;
    let manifest: Value = serde_json::from_slice(&text).unwrap();
    Some(format!(
        "note: out resumes from epoch {}\n",
        manifest["epoch"]
    ))
}
