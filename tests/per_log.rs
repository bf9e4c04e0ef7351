//! Values that differ from log to log: zeros of sensors are named, sized and not carried over to other logs.

use std::path::Path;

use rand::SeedableRng;
use residyn_core::data::{Joint, Log};
use residyn_core::model::Library;
use residyn_io::plant_from_text;
use serde_json::Value;

use crate::support::Scratch;
use crate::support::reports::{estimate, names};

/// Sensor zeros of the training logs in rad, then the test log's.
const OFFSETS: [f64; 4] = [0.03, -0.02, 0.04, 0.01];

/// A hanging pendulum, 15 s a log, noise of 1 mrad.
const RIG: &str = "model = \"pendulum\"\nparameters = { C_g = -17.4, C_i = 4.6 }\n\
    sensor = { rate_hz = 100, position_noise = 1e-3, position_step = 0 }\n\
    excitation = { amplitude = [1.6], band_hz = [0.15, 2.0], tones = 8 }\n\
    recording = { logs = 1, duration_s = 15, start = [0, 0] }\n";

/// The report on logs of the rig, each with its own effect.
fn closed(scratch: &Scratch, effect: impl Fn(usize) -> String) -> Value {
    scratch.file("rig.toml", RIG);
    for (k, seed) in (0..OFFSETS.len()).zip(1..) {
        scratch.simulates(&format!("rig.toml --effect {}", effect(k)), &[seed]);
    }
    let logs = "--train run1.csv run2.csv run3.csv --test run4.csv";
    scratch.json(&format!("closeloop --model pendulum {logs} --out report"))
}

#[test]
fn zeros_that_differ_between_logs_are_a_sensor_offset() {
    let scratch = Scratch::new();
    let report = closed(&scratch, |k| format!("sensor_offset={}", OFFSETS[k]));
    assert_eq!(names(&report), ["sensor_offset"]);
    assert_eq!(report["verdict"], "explained");
    let parameters = report["effects"][0]["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 3);
    for (k, parameter) in parameters.iter().enumerate() {
        assert_eq!(parameter["name"], "q_z1");
        assert_eq!(parameter["log"], format!("run{}.csv", k + 1));
        let [value, low, high] = estimate(parameter).unwrap();
        assert!(low < value && value < high);
        // Twice the interval misses the truth only once in ten thousand times.
        let reach = high - low;
        assert!((value - OFFSETS[k]).abs() < reach, "{parameter}");
        assert!(reach < 5e-3, "{parameter}");
    }
    let error = |log: &str| {
        let found = scratch.json(&format!("evaluate --model report/model.toml --test {log}"));
        found["position_rmse"][2][0].as_f64().unwrap()
    };
    // The error due to the test log's zero disappears when its first second determines the zero.
    let rmse = |model: &str| report["error"][model]["position_rmse"][2][0].as_f64();
    assert!(rmse("zeroed").unwrap() < rmse("after").unwrap());
    // The file keeps the values of the training logs, and says nothing about other logs.
    let found = scratch.read("report/model.toml");
    assert!(found.contains("q_z = { value = 0.0, logs = { \"run1.csv\" = { value = 0.0"));
    std::fs::copy(scratch.path("run3.csv"), scratch.path("elsewhere.csv")).unwrap();
    assert!(2.0 * error("run3.csv") < error("elsewhere.csv"));
    assert_eq!(rmse("after"), Some(error("run4.csv")));
}

#[test]
fn a_zero_that_all_logs_share_is_a_tilt() {
    let scratch = Scratch::new();
    let report = closed(&scratch, |_| "gravity_tilt=0.03".to_owned());
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
