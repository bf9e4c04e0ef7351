//! `residyn sweep`, through the binary.

use std::path::Path;

use serde_json::Value;

use crate::support::paths::configs;
use crate::support::{refuses, residyn, succeeds, text};

fn sweep(config: &str, out: &Path, more: &[&str]) -> Value {
    let config = configs().join(config);
    let fixed = ["sweep", "--config", text(&config), "--out", text(out)];
    let printed = succeeds(&[&fixed, more, &["--json"]].concat());
    let written = std::fs::read_to_string(out.join("sweep.json")).unwrap();
    assert_eq!(printed, written);
    serde_json::from_str(&written).unwrap()
}

fn numbers(result: &Value, key: &str) -> Vec<f64> {
    let models = result["models"].as_array().unwrap().iter();
    models.map(|model| model[key].as_f64().unwrap()).collect()
}

#[test]
fn a_model_depends_on_its_seed_alone() {
    let dir = tempfile::tempdir().unwrap();
    let run = |count: &str, seed: &str| {
        let more = ["--seeds", count, "--seed", seed];
        sweep("smoke/train-pendulum.toml", &dir.path().join(count), &more)
    };
    let found = run("5", "3");
    assert_eq!(numbers(&found, "seed"), [3.0, 4.0, 5.0, 6.0, 7.0]);
    assert_eq!(found["totals"]["models"], 5);
    assert_eq!(found["totals"]["diverged"], 0);
    assert_eq!(found["config"]["device"], "ndarray");
    let errors = numbers(&found, "error");
    assert_eq!(errors[..2], numbers(&run("2", "3"), "error"));
    assert!(errors.windows(2).all(|pair| pair[0] != pair[1]));
    let gravity = found["parameters"]["C_g"]["median"].as_f64().unwrap();
    assert!((14.0..15.5).contains(&gravity), "{gravity}");
    let left = std::fs::read_dir(dir.path().join("5")).unwrap().count();
    assert_eq!(left, 2, "only sweep.json and models.jsonl are left");
}

#[test]
fn a_larger_penalty_leaves_a_smaller_residual() {
    let dir = tempfile::tempdir().unwrap();
    let more = ["--seeds", "3", "--one-seed", "--alpha", "1e-6-1"];
    let found = sweep("smoke/train-pendulum.toml", dir.path(), &more);
    assert_eq!(numbers(&found, "seed"), [0.0; 3]);
    let alphas = numbers(&found, "alpha");
    assert!((alphas[1] / 1e-3 - 1.0).abs() < 1e-12, "{alphas:?}");
    let norms = numbers(&found, "residual_norm");
    assert!(norms[2] < 0.1 * norms[0], "{norms:?}");
}

#[test]
fn the_text_lists_quartiles() {
    let dir = tempfile::tempdir().unwrap();
    let config = configs().join("smoke/train-pendulum-offline.toml");
    let out = ["--out", text(dir.path())];
    let arguments = ["sweep", "--config", text(&config), "--seeds", "4"];
    let printed = succeeds(&[&arguments[..], &out].concat());
    for part in [
        "4 models",
        "0 diverged",
        "prediction error",
        "models per second",
    ] {
        assert!(printed.contains(part), "{part:?} in {printed}");
    }
}

#[test]
fn diverged_models_are_counted_and_null_in_json() {
    let dir = tempfile::tempdir().unwrap();
    let smoke = std::fs::read_to_string(configs().join("smoke/train-pendulum.toml")).unwrap();
    let recipe = smoke
        .replace("../plants", text(&configs().join("plants")))
        .replace("physics = 0.01", "physics = 1e38");
    std::fs::write(dir.path().join("wild.toml"), recipe).unwrap();
    let (config, out) = (dir.path().join("wild.toml"), dir.path().join("out"));
    let (config, out) = (text(&config), text(&out));
    let output = residyn(&["sweep", "--config", config, "--seeds", "2", "--out", out]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("2 diverged"));
    let written = std::fs::read_to_string(dir.path().join("out/sweep.json")).unwrap();
    let found: Value = serde_json::from_str(&written).unwrap();
    assert_eq!(found["models"][0]["error"], Value::Null);
    assert_eq!(found["error"], Value::Null);
}

#[test]
fn contradictory_sweeps_are_refused_with_a_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let smoke = std::fs::read_to_string(configs().join("smoke/train-pendulum.toml")).unwrap();
    let smoke = smoke.replace("../plants", text(&configs().join("plants")));
    let network = smoke.find("[network]").unwrap()..smoke.find("[fit]").unwrap();
    let physics = smoke
        .replace(&smoke[network], "")
        .replace("hybrid", "physics");
    let adaptive = smoke.replace(
        "fixed = { alpha = 1e-4 }",
        "adaptive = { initial = 1, rate = 1 }",
    );
    let offline = configs().join("smoke/train-pendulum-offline.toml");
    let data_driven = std::fs::read_to_string(offline).unwrap();
    let data_driven = data_driven.replace("../plants", text(&configs().join("plants")));
    let range = ["--seeds", "2", "--alpha", "1e-6-1e-2"];
    let cases: [(&str, &[&str], &str); 8] = [
        (&smoke, &["--seeds", "0"], "--seeds"),
        (&smoke, &["--seeds", "2", "--alpha", "2-1"], "swap them"),
        (&smoke, &["--seeds", "2", "--alpha", "2"], "LOW-HIGH"),
        (&smoke, &["--seeds", "1", "--alpha", "1-2"], "raise --seeds"),
        (&smoke, &["--seeds", "2", "--one-seed"], "--alpha"),
        (&physics, &["--seeds", "2"], "has no network"),
        (&adaptive, &range, "leave out --alpha"),
        (&data_driven, &range, "leave out --alpha"),
    ];
    let (config, out) = (dir.path().join("recipe.toml"), dir.path().join("out"));
    for (recipe, more, part) in cases {
        std::fs::write(&config, recipe).unwrap();
        let fixed = ["sweep", "--config", text(&config), "--out", text(&out)];
        let message = refuses(&[&fixed, more].concat());
        assert!(message.contains(part), "{part:?} in {message}");
        assert!(!out.exists());
    }
}
