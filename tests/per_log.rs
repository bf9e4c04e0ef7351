//! Values that differ from log to log: zeros of sensors are named, sized and not carried over to other logs.

use std::path::{Path, PathBuf};

use rand::SeedableRng;
use residyn_core::data::{Joint, Log};
use residyn_core::model::Library;
use residyn_io::plant_from_text;
use serde_json::Value;

use crate::support::{succeeds, text};

/// Sensor zeros of the training logs in rad, then the test log's.
const OFFSETS: [f64; 4] = [0.03, -0.02, 0.04, 0.01];

/// A hanging pendulum, 15 s a log, noise of 1 mrad.
const RIG: &str = "model = \"pendulum\"\nparameters = { C_g = -17.4, C_i = 4.6 }\n\
    sensor = { rate_hz = 100, position_noise = 1e-3, position_step = 0 }\n\
    excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }\n\
    recording = { logs = 1, duration_s = 15, start = [0, 0] }\n";

/// Logs of the rig, each with its own effect.
fn record(folder: &Path, effect: impl Fn(usize) -> String) -> Vec<PathBuf> {
    let plant = folder.join("rig.toml");
    std::fs::write(&plant, RIG).unwrap();
    let one = |k: usize| {
        let out = folder.join(format!("run{k}.csv"));
        let (effect, seed) = (effect(k), (k + 1).to_string());
        let plant = ["simulate", "--plant", text(&plant), "--seed", &seed];
        succeeds(
            &[
                plant.as_slice(),
                &["--effect", &effect, "--out", text(&out)],
            ]
            .concat(),
        );
        out
    };
    (0..OFFSETS.len()).map(one).collect()
}

fn close(folder: &Path, logs: &[PathBuf]) -> Value {
    let paths: Vec<&str> = logs.iter().map(|log| text(log)).collect();
    let (test, train) = paths.split_last().unwrap();
    let out = folder.join("report");
    let all = [
        &["closeloop", "--json", "--model", "pendulum", "--train"],
        train,
        &["--test", test, "--out", text(&out)],
    ];
    serde_json::from_str(&succeeds(&all.concat())).unwrap()
}

fn names(report: &Value) -> Vec<&str> {
    let effects = report["effects"].as_array().unwrap();
    effects
        .iter()
        .map(|e| e["name"].as_str().unwrap())
        .collect()
}

#[test]
fn zeros_that_differ_between_logs_are_a_sensor_offset() {
    let folder = tempfile::tempdir().unwrap();
    let logs = record(folder.path(), |k| format!("sensor_offset={}", OFFSETS[k]));
    let report = close(folder.path(), &logs);
    assert_eq!(names(&report), ["sensor_offset"]);
    assert_eq!(report["verdict"], "explained");
    let parameters = report["effects"][0]["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 3);
    for (k, parameter) in parameters.iter().enumerate() {
        assert_eq!(parameter["name"], "q_z1");
        assert_eq!(parameter["log"], format!("run{k}.csv"));
        let number = |value: &Value| value.as_f64().unwrap();
        let ci = [0, 1].map(|end| number(&parameter["ci95"][end]));
        assert!(ci[0] < number(&parameter["value"]) && number(&parameter["value"]) < ci[1]);
        // Twice the interval misses the truth only once in ten thousand times.
        let reach = ci[1] - ci[0];
        assert!(
            (number(&parameter["value"]) - OFFSETS[k]).abs() < reach,
            "{parameter}"
        );
        assert!(reach < 5e-3, "{parameter}");
    }
    let model = folder.path().join("report/model.toml");
    let error = |log: &Path, model: &Path| {
        let json = succeeds(&[
            "evaluate",
            "--json",
            "--model",
            text(model),
            "--test",
            text(log),
        ]);
        let value: Value = serde_json::from_str(&json).unwrap();
        value["position_rmse"][2][0].as_f64().unwrap()
    };
    // The error due to the test log's zero disappears when its first second determines the zero.
    let rmse = |model: &str| report["error"][model]["position_rmse"][2][0].as_f64();
    assert!(rmse("zeroed").unwrap() < rmse("after").unwrap());
    // The file keeps the values of the training logs, and says nothing about other logs.
    let found = std::fs::read_to_string(&model).unwrap();
    assert!(found.contains("q_z = { value = 0.0, logs = { \"run0.csv\" = { value = 0.0"));
    let elsewhere = folder.path().join("elsewhere.csv");
    std::fs::copy(&logs[2], &elsewhere).unwrap();
    assert!(2.0 * error(&logs[2], &model) < error(&elsewhere, &model));
    assert_eq!(
        report["error"]["after"]["position_rmse"][2][0],
        error(&logs[3], &model)
    );
}

#[test]
fn a_zero_that_all_logs_share_is_a_tilt() {
    let folder = tempfile::tempdir().unwrap();
    let logs = record(folder.path(), |_| "gravity_tilt=0.03".to_owned());
    let report = close(folder.path(), &logs);
    assert_eq!(names(&report), ["gravity_tilt"]);
    assert_eq!(report["error"]["zeroed"], Value::Null);
    let other = &report["alternatives"][0]["effects"][0]["name"];
    assert_eq!(other, "sensor_offset");
}

/// The plant file's start is where the rig is: hanging at rest it stays there, and the sensor reads its zero.
#[test]
fn a_simulated_rig_starts_at_its_true_angle() {
    let library = Library::built_in();
    let rig = RIG.replace("[1.6]", "[0.0]").replace("1e-3", "0.0");
    let mut plant = plant_from_text(Path::new("rig.toml"), &rig, &library).unwrap();
    let offset = [("q_z".to_owned(), 0.03)];
    plant
        .add_effect(&library, "sensor_offset", Joint::at(0), &offset)
        .unwrap();
    let log: Log = plant
        .record(&mut rand_chacha::ChaCha8Rng::seed_from_u64(0))
        .unwrap();
    let furthest = log.q[0]
        .iter()
        .map(|q| (q - 0.03).abs())
        .fold(0.0, f64::max);
    assert!(furthest < 1e-12, "{furthest}");
}
