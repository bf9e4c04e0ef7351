//! `residyn sweep`, through the binary.

use serde_json::Value;

use crate::support::tables::rows;
use crate::support::{Scratch, says};

const RECIPE: &str = include_str!("../configs/smoke/train-pendulum.toml");

fn sweep(scratch: &Scratch, line: &str) -> Value {
    let recipe = "--config $REPO/configs/smoke/train-pendulum.toml";
    let printed = scratch.succeeds(&format!("sweep {recipe} {line} --out out --json"));
    assert_eq!(printed, scratch.read("out/sweep.json"));
    scratch.read_json("out/sweep.json")
}

fn numbers(result: &Value, key: &str) -> Vec<f64> {
    let models = result["models"].as_array().unwrap().iter();
    models.map(|model| model[key].as_f64().unwrap()).collect()
}

#[test]
fn a_model_depends_on_its_seed_alone() {
    let scratches = [(); 2].map(|()| Scratch::new());
    let found = sweep(&scratches[0], "--seeds 5 --seed 3");
    assert_eq!(numbers(&found, "seed"), [3.0, 4.0, 5.0, 6.0, 7.0]);
    assert_eq!(found["totals"]["models"], 5);
    assert_eq!(found["totals"]["diverged"], 0);
    assert_eq!(found["config"]["device"], "ndarray");
    let (errors, fewer) = (
        numbers(&found, "error"),
        sweep(&scratches[1], "--seeds 2 --seed 3"),
    );
    assert_eq!(errors[..2], numbers(&fewer, "error"));
    assert!(errors.windows(2).all(|pair| pair[0] != pair[1]));
    let gravity = found["parameters"]["C_g"]["median"].as_f64().unwrap();
    assert!((14.0..15.5).contains(&gravity), "{gravity}");
    let left = std::fs::read_dir(scratches[0].path("out")).unwrap().count();
    assert_eq!(left, 2, "only sweep.json and models.jsonl are left");
}

#[test]
fn a_larger_penalty_leaves_a_smaller_residual() {
    let found = sweep(&Scratch::new(), "--seeds 3 --one-seed --alpha 1e-6-1");
    assert_eq!(numbers(&found, "seed"), [0.0; 3]);
    let alphas = numbers(&found, "alpha");
    assert!((alphas[1] / 1e-3 - 1.0).abs() < 1e-12, "{alphas:?}");
    let norms = numbers(&found, "residual_norm");
    assert!(norms[2] < 0.1 * norms[0], "{norms:?}");
}

#[test]
fn the_text_lists_quartiles() {
    let recipe = "--config $REPO/configs/smoke/train-pendulum-offline.toml";
    let said = Scratch::new().succeeds(&format!("sweep {recipe} --seeds 4 --out out"));
    says(
        &said,
        &[
            "4 models",
            "0 diverged",
            "prediction error",
            "models per second",
        ],
    );
}

#[test]
fn diverged_models_are_counted_and_null_in_json() {
    let scratch = Scratch::new();
    scratch.file(
        "wild.toml",
        RECIPE.replace("physics = 0.01", "physics = 1e38"),
    );
    let output = scratch.run("sweep --config wild.toml --seeds 2 --out out");
    assert_eq!(output.status.code(), Some(1));
    says(&String::from_utf8_lossy(&output.stdout), &["2 diverged"]);
    let found = scratch.read_json("out/sweep.json");
    assert_eq!(found["models"][0]["error"], Value::Null);
    assert_eq!(found["error"], Value::Null);
}

/// Recipes with the flags of a sweep, and a word of the message.
const CONTRADICTIONS: &str = "
usual.toml --seeds 0                          | --seeds
usual.toml --seeds 2 --alpha 2-1              | swap them
usual.toml --seeds 2 --alpha 2                | LOW-HIGH
usual.toml --seeds 1 --alpha 1-2              | raise --seeds
usual.toml --seeds 2 --one-seed               | --alpha
physics.toml --seeds 2                        | has no network
adaptive.toml --seeds 2 --alpha 1e-6-1e-2     | leave out --alpha
data-driven.toml --seeds 2 --alpha 1e-6-1e-2  | leave out --alpha
";

#[test]
fn contradictory_sweeps_are_refused_with_a_remedy() {
    let scratch = Scratch::new();
    let network = RECIPE.find("[network]").unwrap()..RECIPE.find("[fit]").unwrap();
    let physics = RECIPE.replace(&RECIPE[network], "");
    let adaptive = "adaptive = { initial = 1, rate = 1 }";
    for (name, recipe) in [
        ("usual.toml", RECIPE),
        ("physics.toml", &physics.replace("hybrid", "physics")),
        (
            "adaptive.toml",
            &RECIPE.replace("fixed = { alpha = 1e-4 }", adaptive),
        ),
        (
            "data-driven.toml",
            include_str!("../configs/smoke/train-pendulum-offline.toml"),
        ),
    ] {
        scratch.file(name, recipe);
    }
    for [given, word] in rows(CONTRADICTIONS) {
        let message = scratch.refuses(&format!("sweep --out out --config {given}"));
        says(&message, &[&word]);
        assert!(!scratch.has("out"));
    }
}
