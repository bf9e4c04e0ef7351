//! Models that are scored as they are, next to those that are fitted.

use serde_json::Value;

use crate::support::clients::client;
use crate::support::paths::schema_path;
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

/// A scratch folder with logs of the demo rig and a model file of the true rig, friction included.
fn rig() -> Scratch {
    let scratch = Scratch::new();
    scratch.simulates("$REPO/configs/demo.toml", &[1, 2, 3]);
    let model = include_str!("../models/pendulum.toml")
        .replace("value = 15.0", "value = -17.4")
        .replace("value = 3.0", "value = 4.6");
    let friction = "\n[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.16\n";
    scratch.file("true.toml", model + friction);
    scratch
}

const LOGS: &str = "--train run1.csv run3.csv --test run2.csv --out out";

#[test]
fn models_are_scored_as_they_are_on_the_same_windows() {
    let rig = rig();
    let against = "--against pendulum true.toml";
    let report = rig.json(&format!("closeloop --model pendulum {LOGS} {against}"));
    let error = &report["error"];
    let [pendulum, true_rig] = error["against"].as_array().unwrap().as_slice() else {
        panic!("two models were given: {}", error["against"]);
    };
    assert_eq!(pendulum["name"], "pendulum");
    assert_eq!(true_rig["name"], "true.toml");
    assert_eq!(pendulum["windows"], error["before"]["windows"]);
    // The declared model before any fit is this model, and `evaluate` gives it the same score.
    let evaluated = rig.json("evaluate --model pendulum --test run2.csv");
    for measure in [
        "position_rmse",
        "position_median",
        "velocity_rmse",
        "windows",
        "diverged",
    ] {
        assert_eq!(pendulum[measure], error["declared"][measure], "{measure}");
        assert_eq!(pendulum[measure], evaluated[measure], "{measure}");
    }
    let rmse = |model: &Value| model["position_rmse"][1][0].as_f64().unwrap();
    assert!(rmse(true_rig) < 0.2 * rmse(&error["before"]), "{error}");
    assert!(rmse(&error["before"]) < rmse(&error["declared"]), "{error}");
    for file in ["out/report.md", "out/errors.svg"] {
        says(&rig.read(file), &["true.toml"]);
    }
}

/// Another model, and words of the message.
const OTHERS: &str = "
nowhere.toml | nowhere.toml ... give a model file or one of
acrobot      | --against acrobot ... 2 joint(s) ... pendulum has 1 joint(s) ... same rig
drive        | --against drive ... slide ... turn
";

#[test]
fn models_of_other_rigs_and_files_that_cannot_be_read_are_refused() {
    let rig = rig();
    for [other, words] in rows(OTHERS) {
        let line = format!("closeloop --model pendulum {LOGS} --against {other}");
        says_words(&rig.refuses(&line), &words);
        assert!(!rig.has("out"), "a folder was left behind");
    }
}

mod slow {
    use super::*;

    #[test]
    fn declared_values_that_the_logs_contradict_are_named_with_their_factor() {
        let rig = rig();
        rig.file("off.toml", rig.read("true.toml").replace("4.6", "9.2"));
        let said = rig.succeeds(&format!("closeloop --model off.toml {LOGS}"));
        says(&said, &["as written     fitted  with effects"]);
        let report = rig.read_json("out/report.json");
        let contradicted = report["contradicted"].as_array().unwrap();
        let c_i = contradicted
            .iter()
            .find(|one| one["name"] == "C_i")
            .unwrap();
        assert_eq!(c_i["declared"], 9.2);
        assert!((c_i["value"].as_f64().unwrap() - 4.6).abs() < 0.1, "{c_i}");
        says(
            &rig.read("out/report.md"),
            &["- `C_i`: declared 9.2, fitted 4.", "): 0.50 times as large"],
        );
        // The inputs let a reader check that the files are the ones that were read.
        let files = report["call"]["inputs"].as_array().unwrap().iter();
        let roles: Vec<&str> = files.map(|file| file["role"].as_str().unwrap()).collect();
        assert_eq!(roles, ["model", "train", "train", "test"]);
        client("report.py", &[&rig.path("out"), &schema_path()]);
    }
}
