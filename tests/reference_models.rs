//! Models that are scored as they are, next to those that are fitted.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::clients::client;
use crate::support::paths::schema_path;
use crate::support::{refuses, succeeds, text};

/// A scratch folder with logs of the demo rig and a model file of the true rig, friction included.
struct Rig {
    folder: tempfile::TempDir,
    train: [PathBuf; 2],
    test: PathBuf,
    true_rig: PathBuf,
}

fn rig() -> Rig {
    let folder = tempfile::tempdir().unwrap();
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/demo.toml");
    let record = |name: &str, seed: &str| {
        let log = folder.path().join(name);
        succeeds(&[
            "simulate",
            "--plant",
            plant,
            "--seed",
            seed,
            "--out",
            text(&log),
        ]);
        log
    };
    let train = [record("train1.csv", "1"), record("train2.csv", "3")];
    let test = record("test.csv", "2");
    let true_rig = folder.path().join("true.toml");
    let model = include_str!("../models/pendulum.toml")
        .replace("value = 15.0", "value = -17.4")
        .replace("value = 3.0", "value = 4.6");
    let friction = "\n[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.16\n";
    fs::write(&true_rig, model + friction).unwrap();
    Rig {
        folder,
        train,
        test,
        true_rig,
    }
}

impl Rig {
    /// `closeloop` of the pendulum on these logs, compared with other models.
    fn command<'a>(&'a self, out: &'a Path, against: &[&'a str]) -> Vec<&'a str> {
        let [first, second] = &self.train;
        let logs = [
            "--train",
            text(first),
            text(second),
            "--test",
            text(&self.test),
        ];
        let model = ["closeloop", "--model", "pendulum", "--out", text(out)];
        [&model[..], &logs, &["--against"], against].concat()
    }
}

#[test]
fn models_are_scored_as_they_are_on_the_same_windows() {
    let rig = rig();
    let out = rig.folder.path().join("report");
    let against = ["pendulum", text(&rig.true_rig)];
    let json = succeeds(&[&rig.command(&out, &against)[..], &["--json"]].concat());
    let report: Value = serde_json::from_str(&json).unwrap();
    let error = &report["error"];
    let [pendulum, true_rig] = error["against"].as_array().unwrap().as_slice() else {
        panic!("two models were given: {}", error["against"]);
    };
    assert_eq!(pendulum["name"], "pendulum");
    assert_eq!(true_rig["name"], text(&rig.true_rig));
    assert_eq!(pendulum["windows"], error["before"]["windows"]);
    // The declared model before any fit is this model, and `evaluate` gives it the same score.
    let evaluated = succeeds(&[
        "evaluate",
        "--json",
        "--model",
        "pendulum",
        "--test",
        text(&rig.test),
    ]);
    let evaluated: Value = serde_json::from_str(&evaluated).unwrap();
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
    for file in ["report.md", "errors.svg"] {
        let written = fs::read_to_string(out.join(file)).unwrap();
        assert!(
            written.contains("true.toml"),
            "{file} is silent about a model"
        );
    }
}

#[test]
fn models_of_other_rigs_and_files_that_cannot_be_read_are_refused() {
    let rig = rig();
    let out = rig.folder.path().join("out");
    let says = |other: &str, parts: &[&str]| {
        let message = refuses(&rig.command(&out, &[other]));
        for part in parts {
            assert!(message.contains(part), "{part:?} is missing in:\n{message}");
        }
        assert!(!out.exists(), "a folder was left behind");
    };
    says(
        "nowhere.toml",
        &["nowhere.toml", "give a model file or one of"],
    );
    says(
        "acrobot",
        &[
            "--against acrobot",
            "2 joint(s)",
            "pendulum has 1 joint(s)",
            "same rig",
        ],
    );
    says("drive", &["--against drive", "slide", "turn"]);
}

mod slow {
    use super::*;

    #[test]
    fn declared_values_that_the_logs_contradict_are_named_with_their_factor() {
        let rig = rig();
        let model = rig.folder.path().join("off.toml");
        let off = fs::read_to_string(&rig.true_rig)
            .unwrap()
            .replace("4.6", "9.2");
        fs::write(&model, off).unwrap();
        let out = rig.folder.path().join("report");
        let said = succeeds(&[
            "closeloop",
            "--model",
            text(&model),
            "--train",
            text(&rig.train[0]),
            text(&rig.train[1]),
            "--test",
            text(&rig.test),
            "--out",
            text(&out),
        ]);
        assert!(
            said.contains("as written     fitted  with effects"),
            "{said}"
        );
        let report: Value =
            serde_json::from_str(&fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
        let contradicted = report["contradicted"].as_array().unwrap();
        let c_i = contradicted
            .iter()
            .find(|one| one["name"] == "C_i")
            .unwrap();
        assert_eq!(c_i["declared"], 9.2);
        assert!((c_i["value"].as_f64().unwrap() - 4.6).abs() < 0.1, "{c_i}");
        let written = fs::read_to_string(out.join("report.md")).unwrap();
        let line = "- `C_i`: declared 9.2, fitted 4.";
        assert!(
            written.contains(line) && written.contains("): 0.50 times as large"),
            "{written}"
        );
        // The inputs let a reader check that the files are the ones that were read.
        let files = report["call"]["inputs"].as_array().unwrap().iter();
        let roles: Vec<&str> = files.map(|file| file["role"].as_str().unwrap()).collect();
        assert_eq!(roles, ["model", "train", "train", "test"]);
        client("report.py", &[&out, &schema_path()]);
    }
}
