//! The demo: an effect that the model does not declare is named and sized, and earns its place.

use std::sync::OnceLock;

use serde_json::Value;

use crate::support::reports::{error, names};
use crate::support::{Scratch, says};

fn demo(seed: u32) -> (Value, Scratch) {
    let scratch = Scratch::new();
    let report = scratch.json(&format!("closeloop --seed {seed} --out report"));
    (report, scratch)
}

/// The demo's report of seed 0, made once for all tests of this file.
fn first_report() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| demo(0).0)
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
fn other_commands_read_the_written_files() {
    let (report, scratch) = demo(4);
    for file in [
        "report.json",
        "report.md",
        "model.toml",
        "predictions.svg",
        "residual.svg",
        "errors.svg",
    ] {
        assert!(scratch.path("report").join(file).is_file(), "{file}");
    }
    scratch.simulates("$REPO/configs/demo.toml", &[9]);
    let fitted = scratch.evaluated("--model report/model.toml --test run9.csv");
    assert!(fitted < 0.01, "{fitted}");
    let hybrid = scratch.evaluated("--checkpoint report/checkpoint --test run9.csv");
    assert!((hybrid - fitted).abs() < 0.2 * fitted, "{hybrid} {fitted}");
    // The written model, closed again, lacks no effect.
    let given = "--model report/model.toml --train run9.csv";
    let again = scratch.json(&format!("closeloop {given} --out again"));
    assert_eq!(again["verdict"], "no_missing_effect");
    assert_eq!(report["files"]["checkpoint"], "checkpoint");
}

#[test]
fn a_checkpoint_of_another_model_is_refused() {
    let (_, scratch) = demo(5);
    let refused_on_log_of = |plant: &str| {
        let simulate = format!("simulate --plant {plant} --duration 2");
        scratch.succeeds(&format!("{simulate} --out {plant}.csv"));
        scratch.refuses(&format!(
            "evaluate --checkpoint report/checkpoint --test {plant}.csv"
        ))
    };
    says(&refused_on_log_of("acrobot"), &["joint"]);
    // A checkpoint whose weights do not belong to its model file.
    let model = include_str!("../models/drive.toml");
    scratch.file("report/checkpoint/model.toml", model);
    says(&refused_on_log_of("pendulum"), &["pendulum", "drive"]);
}

mod slow {
    use super::*;

    #[test]
    fn the_demo_names_the_hidden_effect_with_its_size() {
        for seed in 0..3 {
            let (report, _) = demo(seed);
            assert_eq!(report["verdict"], "explained", "seed {seed}");
            assert_eq!(names(&report), ["coulomb_friction"], "seed {seed}");
            let effect = &report["effects"][0];
            assert_eq!(effect["expression"], "-F_c1 * sign(qd1)");
            let value = effect["parameters"][0]["value"].as_f64().unwrap();
            assert!(
                (value - TRUE_F_C).abs() < 0.01 * TRUE_F_C,
                "seed {seed}: {value}"
            );
            let [before, after] = ["before", "after"].map(|model| error(&report, model));
            assert!(after <= 0.25 * before, "seed {seed}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_report() {
        let [(first, _), (second, _)] = [3, 3].map(demo);
        assert_eq!(without_call(first), without_call(second));
    }

    #[test]
    fn a_search_whose_time_is_spent_stops_and_says_so() {
        let scratch = Scratch::new();
        let closed = |budget: &str| -> Value {
            let line = format!("closeloop --json --budget {budget} --out {budget}");
            serde_json::from_slice(&scratch.run(&line).stdout).unwrap()
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
        let timings = scratch.read_json("5min/timings.json");
        let stages: Vec<&Value> = (timings.as_array().unwrap().iter())
            .map(|t| &t["stage"])
            .collect();
        assert!(stages.len() >= 7 && stages[0] == "audit", "{timings}");
        let error = scratch.refuses("closeloop --budget soon");
        says(&error, &["--budget <TIME>"]);
    }

    #[test]
    fn calibration_reports_false_alarms_and_detection_limits() {
        let calibrated = || {
            let scratch = Scratch::new();
            let report = scratch.json("closeloop --seed 3 --calibrate 2 --out report");
            for (file, heading) in [
                ("report.md", "## What these logs could show"),
                ("report.html", "<h3>What these logs could show</h3>"),
            ] {
                says(&scratch.read(&format!("report/{file}")), &[heading]);
            }
            without_call(report)
        };
        let [first, second] = [calibrated(), calibrated()];
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
        let (plain, _) = demo(3);
        assert!(plain["calibration"].is_null());
        assert_eq!(plain["error"], first["error"]);
    }
}
