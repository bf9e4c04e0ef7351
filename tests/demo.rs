//! The demo: an effect that the model does not declare is named and sized, and earns its place.

use std::sync::OnceLock;

use serde_json::Value;

use crate::support::{evaluated, refuses, residyn, succeeds, text};

fn demo(seed: &str) -> (Value, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let json = succeeds(&["closeloop", "--json", "--seed", seed, "--out", text(&out)]);
    (serde_json::from_str(&json).unwrap(), folder)
}

/// The demo's report of seed 0, made once for all tests of this file.
fn first_report() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| demo("0").0)
}

/// A report without the time and the command that made it.
fn without_call(mut report: Value) -> Value {
    let call = report["call"].take();
    assert!(call["took_s"].as_f64().unwrap() > 0.0, "{call}");
    report
}

/// The true value, as in configs/demo.toml.
const TRUE_F_C: f64 = 0.16;

#[test]
fn the_true_value_lies_inside_its_interval() {
    let report = first_report();
    let ci: Vec<f64> =
        serde_json::from_value(report["effects"][0]["parameters"][0]["ci95"].clone()).unwrap();
    assert!(ci[0] < TRUE_F_C && TRUE_F_C < ci[1], "{ci:?}");
}

#[test]
fn the_effect_is_drawn_by_its_formula_with_its_interval() {
    let report = first_report();
    let parameter = &report["effects"][0]["parameters"][0];
    let curve = &report["plots"]["residuals"][0]["effects"][0];
    assert_eq!(
        (&curve["variable"], &curve["effects"]),
        (&"qd".into(), &serde_json::json!(["coulomb_friction"]))
    );
    let ends = |of: &Value| -> [f64; 2] {
        let all: Vec<f64> = serde_json::from_value(of.clone()).unwrap();
        [all[0], all[all.len() - 1]]
    };
    let [backwards, forwards] = ends(&curve["x"]);
    assert!(backwards < 0.0 && 0.0 < forwards, "{curve}");
    let near = |a: f64, b: f64| (a - b).abs() < 1e-4;
    let size = parameter["value"].as_f64().unwrap();
    let [against, along] = ends(&curve["force"]);
    assert!(near(against, size) && near(along, -size), "{curve}");
    let interval = ends(&parameter["ci95"]);
    let band = [ends(&curve["low"])[0], ends(&curve["high"])[0]];
    assert!(
        near(band[0], interval[0]) && near(band[1], interval[1]),
        "{curve}"
    );
}

#[test]
fn the_pendulum_is_drawn_at_its_logged_angles() {
    let report = first_report();
    let numbers = |of: &Value| -> Vec<f64> { serde_json::from_value(of.clone()).unwrap() };
    let (motion, segment) = (&report["plots"]["motion"], &report["plots"]["segments"][0]);
    let (logged_s, angles) = (
        numbers(&segment["time"]),
        numbers(&segment["joints"][0]["measured"]),
    );
    let lines = motion["pictures"][0]["measured"].as_array().unwrap();
    let mut sides = Vec::new();
    for (time_s, line) in numbers(&motion["time"]).iter().zip(lines) {
        let Some(row) = logged_s.iter().position(|t| (t - time_s).abs() < 1e-6) else {
            continue;
        };
        let tip = line.as_str().unwrap().split(' ').next_back().unwrap();
        let (x, y) = tip.split_once(',').unwrap();
        let [x, y]: [f64; 2] = [x, y].map(|text| text.parse().unwrap());
        let angle = angles[row];
        assert!(
            (y / x.hypot(y) - angle.cos()).abs() < 5e-3,
            "{tip} at {angle}"
        );
        if angle.sin().abs() > 0.1 {
            sides.push((x * angle.sin()).signum());
        }
    }
    assert!(sides.len() > 50 && sides.iter().all(|side| *side == sides[0]));
}

#[test]
fn a_calibration_of_no_runs_is_refused() {
    let message = refuses(&["closeloop", "--calibrate", "0"]);
    assert!(message.contains("--calibrate"), "{message}");
}

#[test]
fn other_commands_read_the_written_files() {
    let (report, folder) = demo("4");
    let out = folder.path().join("report");
    for file in [
        "report.json",
        "report.md",
        "model.toml",
        "predictions.svg",
        "residual.svg",
        "errors.svg",
    ] {
        assert!(out.join(file).is_file(), "{file}");
    }
    let log = folder.path().join("new.csv");
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/demo.toml");
    succeeds(&[
        "simulate",
        "--plant",
        plant,
        "--seed",
        "9",
        "--out",
        text(&log),
    ]);
    let error = |model: &[&str]| evaluated(model, text(&log));
    let (model, checkpoint) = (out.join("model.toml"), out.join("checkpoint"));
    let fitted = error(&["--model", text(&model)]);
    assert!(fitted < 0.01, "{fitted}");
    let hybrid = error(&["--checkpoint", text(&checkpoint)]);
    assert!((hybrid - fitted).abs() < 0.2 * fitted, "{hybrid} {fitted}");
    // The written model, closed again, lacks no effect.
    let again = folder.path().join("again");
    let json = succeeds(&[
        "closeloop",
        "--json",
        "--model",
        text(&model),
        "--train",
        text(&log),
        "--out",
        text(&again),
    ]);
    let again: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(again["verdict"], "no_missing_effect");
    assert_eq!(report["files"]["checkpoint"], "checkpoint");
}

#[test]
fn a_checkpoint_of_another_model_is_refused() {
    let (_report, folder) = demo("5");
    let checkpoint = folder.path().join("report/checkpoint");
    let refused_on_log_of = |plant: &str| {
        let log = folder.path().join(plant).with_extension("csv");
        let simulate = ["simulate", "--plant", plant, "--out", text(&log)];
        succeeds(&[&simulate[..], &["--duration", "2"]].concat());
        let evaluate = ["evaluate", "--checkpoint", text(&checkpoint)];
        refuses(&[&evaluate[..], &["--test", text(&log)]].concat())
    };
    let message = refused_on_log_of("acrobot");
    assert!(message.contains("joint"), "{message}");
    // A checkpoint whose weights do not belong to its model file.
    let model = include_str!("../models/drive.toml");
    std::fs::write(checkpoint.join("model.toml"), model).unwrap();
    let message = refused_on_log_of("pendulum");
    assert!(
        message.contains("pendulum") && message.contains("drive"),
        "{message}"
    );
}

mod slow {
    use super::*;

    #[test]
    fn the_demo_names_the_hidden_effect_with_its_size() {
        for seed in ["0", "1", "2"] {
            let (report, _folder) = demo(seed);
            assert_eq!(report["verdict"], "explained", "seed {seed}");
            let effects = report["effects"].as_array().unwrap();
            assert_eq!(effects.len(), 1, "seed {seed}: {effects:?}");
            assert_eq!(effects[0]["name"], "coulomb_friction");
            assert_eq!(effects[0]["expression"], "-F_c1 * sign(qd1)");
            let parameter = &effects[0]["parameters"][0];
            let value = parameter["value"].as_f64().unwrap();
            assert!(
                (value - TRUE_F_C).abs() < 0.01 * TRUE_F_C,
                "seed {seed}: {value}"
            );
            let rmse = |model: &str| {
                report["error"][model]["position_rmse"][1][0]
                    .as_f64()
                    .unwrap()
            };
            assert!(rmse("after") <= 0.25 * rmse("before"), "seed {seed}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_report() {
        let [(first, _a), (second, _b)] = ["3", "3"].map(demo);
        assert_eq!(without_call(first), without_call(second));
    }

    #[test]
    fn a_search_whose_time_is_spent_stops_and_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let closed = |budget: &str| -> Value {
            let out = folder.path().join(budget);
            let json = residyn(&[
                "closeloop",
                "--json",
                "--budget",
                budget,
                "--out",
                text(&out),
            ]);
            serde_json::from_slice(&json.stdout).unwrap()
        };
        let report = closed("1us");
        assert_eq!(
            (&report["stopped"], &report["verdict"]),
            (&true.into(), &"inconclusive".into())
        );
        assert_eq!(report["effects"], serde_json::json!([]));
        assert_eq!(report["configuration"]["budget"], "1us");
        let report = closed("5min");
        assert_eq!(
            (&report["stopped"], &report["verdict"]),
            (&false.into(), &"explained".into())
        );
        let timings = std::fs::read(folder.path().join("5min/timings.json")).unwrap();
        let timings: Value = serde_json::from_slice(&timings).unwrap();
        let stages: Vec<&Value> = (timings.as_array().unwrap().iter())
            .map(|t| &t["stage"])
            .collect();
        assert!(stages.len() >= 7 && stages[0] == "audit", "{timings}");
        let error = refuses(&["closeloop", "--budget", "soon"]);
        assert!(error.contains("--budget <TIME>"), "{error}");
    }

    #[test]
    fn calibration_reports_false_alarms_and_detection_limits() {
        let folder = tempfile::tempdir().unwrap();
        let calibrated = |seed: &str, name: &str| {
            let out = folder.path().join(name);
            let out = text(&out);
            let arguments = [
                "closeloop",
                "--json",
                "--seed",
                seed,
                "--calibrate",
                "2",
                "--out",
                out,
            ];
            let report: Value = serde_json::from_str(&succeeds(&arguments)).unwrap();
            for (file, heading) in [
                ("report.md", "## What these logs could show"),
                ("report.html", "<h3>What these logs could show</h3>"),
            ] {
                let written = std::fs::read_to_string(folder.path().join(name).join(file)).unwrap();
                assert!(written.contains(heading), "{file}");
            }
            report
        };
        let (first, second) = (calibrated("3", "first"), calibrated("3", "second"));
        let [first, second] = [first, second].map(without_call);
        assert_eq!(first, second);
        let calibration = &first["calibration"];
        assert_eq!(
            (&calibration["runs"], &calibration["alarms"]),
            (&2.into(), &0.into())
        );
        let smallest = calibration["smallest"].as_array().unwrap();
        let of = |name: &str| smallest.iter().find(|entry| entry["effect"] == name);
        // The effect found belongs to the model; an effect hidden in addition is found.
        assert!(of("coulomb_friction").is_none());
        let drag = of("viscous_friction").unwrap();
        assert!(drag["value"].as_f64().unwrap() > 0.0);
        assert_eq!(drag["verified"], true);
        // The rest of the report is the same as without calibration.
        let (plain, _folder) = demo("3");
        assert!(plain["calibration"].is_null());
        assert_eq!(plain["error"], first["error"]);
    }
}
