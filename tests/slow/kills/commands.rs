//! The long-running commands, with settings for a second or less.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::in_folder::json;
use crate::support::paths::config;
use crate::support::{replaced, words};

/// A command that works in the folder `out`.
pub struct Long {
    pub name: &'static str,
    pub arguments: Vec<String>,
    /// Makes the command's input.
    pub prepare: fn(&Path),
    /// The message with which it continues from existing files; `None` if it says nothing or no files exist.
    pub goes_on: fn(&Path) -> Option<String>,
}

fn long(name: &'static str, line: &str) -> Long {
    Long {
        name,
        arguments: words(line).chain(words("--out out")).collect(),
        prepare: |_| (),
        goes_on: |_| None,
    }
}

/// Run a command that makes input, in this folder.
fn run(folder: &Path, line: &str) {
    let line: Vec<String> = words(line).collect();
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    json(folder, &line);
}

const RECIPE: &str = "--config $REPO/configs/smoke/train-pendulum.toml";
const EXPERIMENT: &str = "--config $REPO/configs/smoke/physics-prior-pendulum.toml";

pub fn train() -> Long {
    Long {
        goes_on: epoch,
        ..long("train", &format!("train {RECIPE} --save-every 20"))
    }
}

pub fn tune() -> Long {
    let recipe = "--config $REPO/configs/smoke/tune-pendulum.toml";
    let line = format!("tune --checkpoint prior {recipe} --save-every 20");
    Long {
        prepare: |folder| run(folder, &format!("train {RECIPE} --out prior")),
        goes_on: epoch,
        ..long("tune", &line)
    }
}

pub fn sweep() -> Long {
    long("sweep", &format!("sweep {RECIPE} --seeds 4"))
}

pub fn mbrl() -> Long {
    long("mbrl", &format!("mbrl {EXPERIMENT}"))
}

pub fn experiment() -> Long {
    long(
        "experiment",
        &format!("experiment physics-prior {EXPERIMENT}"),
    )
}

pub fn bench() -> Long {
    Long {
        prepare: |folder| {
            let grid = fs::read_to_string(config("bench/smoke.toml")).unwrap();
            let (usual, short) = ("logs = 3\nseconds = 8", "logs = 2\nseconds = 3");
            fs::write(folder.join("grid.toml"), replaced(&grid, usual, short)).unwrap();
        },
        ..long("bench", "bench effects --grid grid.toml")
    }
}

pub fn closeloop() -> Long {
    let line = "closeloop --model pendulum --train run1.csv --test run2.csv --calibrate 2";
    Long {
        prepare: |folder| {
            for seed in [1, 2] {
                let plant = "--plant pendulum --duration 5 --effect coulomb_friction=0.3";
                let own = format!("--seed {seed} --out run{seed}.csv");
                run(folder, &format!("simulate {plant} {own}"));
            }
        },
        goes_on: |root| {
            let kept = fs::read_to_string(root.join("out/simulations.jsonl")).ok()?;
            let whole = kept.matches('\n').count();
            (whole > 0).then(|| format!("note: out has {whole} of "))
        },
        ..long("closeloop", line)
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
