//! Two explanations that the logs cannot distinguish: the experiment that the report proposes does, if there is one.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{succeeds, text};

/// A plant file: a model, its one hidden effect, then excitation, noise and start.
fn plant(
    folder: &Path,
    name: &str,
    [model, effect, torque, start]: [&str; 4],
    noise: f64,
) -> PathBuf {
    let path = folder.join(name);
    let plant = format!(
        "model = {model}\n[[effect]]\njoint = 1\n{effect}\n\
         [sensor]\nrate_hz = 100\nposition_noise = {noise}\nposition_step = 0\n\
         [excitation]\n{torque}\n[recording]\nlogs = 1\nduration_s = 6\nstart = {start}\n"
    );
    std::fs::write(&path, plant).unwrap();
    path
}

/// Logs of a plant, one per seed.
fn record(plant: &Path, seeds: std::ops::Range<u32>, duration_s: &str) -> Vec<String> {
    let log = |seed: u32| {
        let seed = seed.to_string();
        let out = plant.with_extension(format!("{seed}.csv"));
        let arguments = [
            "--seed",
            &seed,
            "--duration",
            duration_s,
            "--out",
            text(&out),
        ];
        succeeds(&[&["simulate", "--plant", text(plant)], &arguments[..]].concat());
        text(&out).to_owned()
    };
    seeds.map(log).collect()
}

fn report(model: &str, train: &[String], test: &[String]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let mut arguments = vec!["closeloop", "--json", "--model", model, "--out", text(&out)];
    for (flag, logs) in [("--train", train), ("--test", test)] {
        arguments.push(flag);
        arguments.extend(logs.iter().map(String::as_str));
    }
    serde_json::from_str(&succeeds(&arguments)).unwrap()
}

fn effects(report: &Value) -> Vec<&str> {
    let effects = report["effects"].as_array().unwrap();
    effects
        .iter()
        .map(|e| e["name"].as_str().unwrap())
        .collect()
}

/// The alternative that has this effect.
fn alternative<'r>(report: &'r Value, effect: &str) -> Option<&'r Value> {
    let has = |a: &&Value| {
        a["effects"]
            .as_array()
            .unwrap()
            .iter()
            .any(|e| e["name"] == effect)
    };
    report["alternatives"].as_array().unwrap().iter().find(has)
}

/// Small swings at one speed: friction proportional to speed and drag proportional to its square look the same.
#[test]
fn the_proposed_experiment_tells_what_the_logs_did_not() {
    let folder = tempfile::tempdir().unwrap();
    let rig = |name, torque, start| {
        let said = [
            "\"pendulum\"\n[parameters]\nC_g = -17.4\nC_i = 4.6",
            "name = \"viscous_friction\"\nb = 0.03",
        ];
        plant(folder.path(), name, [said[0], said[1], torque, start], 3e-3)
    };
    let swinging = rig(
        "swing.toml",
        "amplitude = [0.3]\nband_hz = [0.5, 0.6]\ntones = 1",
        "[0, 0]",
    );
    let (train, test) = (record(&swinging, 1..5, "6"), record(&swinging, 5..7, "6"));
    let before = report("pendulum", &train, &test);
    assert_eq!(effects(&before), ["viscous_friction"]);
    let doubtful = alternative(&before, "quadratic_drag").expect("the logs do not tell");
    let (words, numbers) = (
        doubtful["experiment"].as_str().unwrap(),
        &doubtful["separation"],
    );
    let speed = words
        .strip_prefix("let joint 1 coast without torque from ")
        .expect(words);
    let speed = speed.split(' ').next().unwrap();
    assert!(words.contains(numbers["experiment"].as_str().unwrap()));
    let rad = |key: &str| numbers[key].as_f64().unwrap();
    assert!(
        rad("difference_rad") > 2.0 * rad("present_difference_rad"),
        "{numbers}"
    );
    assert!((rad("noise_rad") - 3e-3).abs() < 3e-4, "{numbers}");

    let coasting = rig(
        "coast.toml",
        "amplitude = [0]\nband_hz = [0.5, 0.6]\ntones = 1",
        &format!("[0, {speed}]"),
    );
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few seconds
    let logs = (numbers["seconds"].as_f64().unwrap() / 2.0).ceil() as u32;
    let more = record(&coasting, 0..logs, "2");
    let after = report("pendulum", &[train, more].concat(), &test);
    assert_eq!(effects(&after), ["viscous_friction"]);
    assert!(
        alternative(&after, "quadratic_drag").is_none(),
        "{}",
        after["alternatives"]
    );
}

/// A drive that delivers less and a rotor that takes more: the same acceleration. Only another mass distinguishes them.
fn sled(parameters: &str, mass: &str) -> (Value, Value) {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("sled.model.toml");
    let declared = format!(
        "[system]\nname = \"sled\"\njoints = 1\nprismatic = [1]\n{parameters}\n[dynamics]\nmass = [[\"{mass}\"]]\nbias = [\"0\"]\n"
    );
    std::fs::write(&model, declared).unwrap();
    let (named, torque) = (
        format!("{:?}", text(&model)),
        "amplitude = [2]\nband_hz = [0.3, 2]\ntones = 5",
    );
    let said = [
        named.as_str(),
        "name = \"actuator_gain\"\ng = -0.2",
        torque,
        "[0, 0]",
    ];
    let sled = plant(folder.path(), "sled.toml", said, 1e-3);
    let (train, test) = (record(&sled, 1..5, "6"), record(&sled, 5..7, "6"));
    let close = || {
        let report = report(text(&model), &train, &test);
        let other = if effects(&report) == ["rotor_inertia"] {
            "actuator_gain"
        } else {
            "rotor_inertia"
        };
        alternative(&report, other)
            .expect("they are the same")
            .clone()
    };
    (close(), close())
}

#[test]
fn what_is_the_same_in_the_equations_is_said_to_be() {
    let (alternative, again) = sled("", "1.2");
    let words = alternative["experiment"].as_str().unwrap();
    assert!(
        words.starts_with("no simulated change of torque, speed, load or duration"),
        "{words}"
    );
    assert_eq!(alternative["separation"]["seconds"], Value::Null);
    assert_eq!(alternative, again, "the same seed gives the same words");
}

#[test]
fn a_known_payload_tells_a_weak_drive_from_a_heavy_rotor() {
    let (alternative, again) = sled(
        "[parameters]\nm = { value = 1.2, unit = \"kg\", fixed = true }",
        "m",
    );
    let words = alternative["experiment"].as_str().unwrap();
    assert!(
        words.starts_with("a payload that raises `m` by a known 0.600 kg"),
        "{words}"
    );
    assert_eq!(alternative, again, "the same seed gives the same words");
}
