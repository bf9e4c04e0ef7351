//! Two explanations that the logs cannot distinguish: the experiment that the report proposes does, if there is one.

use std::ops::Range;

use serde_json::Value;

use crate::support::Scratch;
use crate::support::reports::names;

/// Logs of a plant, one per seed, such as `swing1.csv`. Its file has a model, its one hidden effect, then excitation,
/// noise and start.
fn record(
    scratch: &Scratch,
    name: &str,
    [model, effect, torque, start]: [&str; 4],
    noise: f64,
    duration_s: u32,
    seeds: Range<u32>,
) {
    let plant = format!(
        "model = {model}\n[[effect]]\njoint = 1\n{effect}\n\
         [sensor]\nrate_hz = 100\nposition_noise = {noise}\nposition_step = 0\n\
         [excitation]\n{torque}\n[recording]\nlogs = 1\nduration_s = 6\nstart = {start}\n"
    );
    scratch.file(&format!("{name}.toml"), plant);
    for seed in seeds {
        let own = format!("--plant {name}.toml --seed {seed} --out {name}{seed}.csv");
        scratch.succeeds(&format!("simulate --duration {duration_s} {own}"));
    }
}

/// Of six logs, the last two are for the test; `more` are for training, too.
fn report(scratch: &Scratch, model: &str, name: &str, more: &str) -> Value {
    let log = |k: u32| format!("{name}{k}.csv");
    let [a, b, c, d, e, f] = [1, 2, 3, 4, 5, 6].map(log);
    let logs = format!("--train {a} {b} {c} {d} {more} --test {e} {f}");
    scratch.json(&format!("closeloop --model {model} {logs} --out report"))
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
    let scratch = Scratch::new();
    let rig = |torque, start| {
        let said = [
            "\"pendulum\"\n[parameters]\nC_g = -17.4\nC_i = 4.6",
            "name = \"viscous_friction\"\nb = 0.03",
        ];
        [said[0], said[1], torque, start]
    };
    let swinging = rig(
        "amplitude = [0.3]\nband_hz = [0.5, 0.6]\ntones = 1",
        "[0, 0]",
    );
    record(&scratch, "swing", swinging, 3e-3, 6, 1..7);
    let before = report(&scratch, "pendulum", "swing", "");
    assert_eq!(names(&before), ["viscous_friction"]);
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

    let start = format!("[0, {speed}]");
    let coasting = rig("amplitude = [0]\nband_hz = [0.5, 0.6]\ntones = 1", &start);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few seconds
    let logs = (numbers["seconds"].as_f64().unwrap() / 2.0).ceil() as u32;
    record(&scratch, "coast", coasting, 3e-3, 2, 0..logs);
    let more: String = (0..logs).map(|seed| format!("coast{seed}.csv ")).collect();
    let after = report(&scratch, "pendulum", "swing", &more);
    assert_eq!(names(&after), ["viscous_friction"]);
    assert!(
        alternative(&after, "quadratic_drag").is_none(),
        "{}",
        after["alternatives"]
    );
}

/// A drive that delivers less and a rotor that takes more: the same acceleration. Only another mass distinguishes them.
fn sled(parameters: &str, mass: &str) -> (Value, Value) {
    let scratch = Scratch::new();
    let declared = format!(
        "[system]\nname = \"sled\"\njoints = 1\nprismatic = [1]\n{parameters}\n[dynamics]\nmass = [[\"{mass}\"]]\nbias = [\"0\"]\n"
    );
    scratch.file("sled.model.toml", declared);
    let sled = [
        "\"sled.model.toml\"",
        "name = \"actuator_gain\"\ng = -0.2",
        "amplitude = [2]\nband_hz = [0.3, 2]\ntones = 5",
        "[0, 0]",
    ];
    record(&scratch, "sled", sled, 1e-3, 6, 1..7);
    let close = || {
        let report = report(&scratch, "sled.model.toml", "sled", "");
        let other = if names(&report) == ["rotor_inertia"] {
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
