//! Chains of many joints: their equations beside those of Pinocchio and MuJoCo.

use std::fs;
use std::path::{Path, PathBuf};

use residyn::model::chain::{Chain, model_text};
use residyn::model::{Library, Model};
use serde::Deserialize;
use serde_json::Value;

use crate::clients::client;
use crate::mechanism::{fixture, read_to};
use crate::support::{measured, refuses, succeeds, text};

/// What Pinocchio and MuJoCo say of an arm.
#[derive(Deserialize)]
struct Arm {
    file: PathBuf,
    tip: Option<String>,
    joints: Vec<String>,
    peers: Vec<String>,
    samples: Vec<Value>,
}

fn model(chain: &Chain) -> Model {
    let library = Library::built_in();
    let path = Path::new(&chain.name);
    let model = Model::from_text(path, &model_text(chain), library.effects()).unwrap();
    // What acts on the joints is none of the rigid bodies'.
    model.with_effects(Vec::new())
}

fn numbers(sample: &Value, key: &str) -> Vec<f64> {
    serde_json::from_value(sample[key].clone()).unwrap()
}

/// Largest difference over the largest of the wanted numbers.
fn off(found: &[f64], wanted: &[f64]) -> f64 {
    let differences = found.iter().zip(wanted).map(|(a, b)| (a - b).abs());
    let size = wanted.iter().map(|x| x.abs()).fold(0.0, f64::max);
    differences.fold(0.0, f64::max) / size
}

#[test]
fn pinocchio_and_mujoco_find_the_same_torques_and_accelerations() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arms.json");
    client("arms.py", &[fixture("").as_path(), &file]);
    let Ok(told) = fs::read_to_string(&file) else {
        return;
    };
    let arms: Vec<Arm> = serde_json::from_str(&told).unwrap();
    assert!(arms.len() > 10, "{} arms", arms.len());
    for arm in arms {
        let name = arm.file.display();
        let chain = read_to(&arm.file, arm.tip.as_deref());
        let joints: Vec<&str> = chain
            .leaders()
            .map(|(_, joint)| joint.name.as_str())
            .collect();
        assert_eq!(joints, arm.joints, "{name}");
        let model = model(&chain);
        let (inverse, forward) = (model.inverse_dynamics().unwrap(), model.dynamics());
        let [values, still] = [model.values(), vec![0.0; model.joints]];
        for sample in &arm.samples {
            let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| numbers(sample, key));
            let inputs = |tau: &[f64]| [&q, &qd, tau, &[0.0], &values].concat();
            let torques = inverse.eval(&[inputs(&still), qdd.clone()].concat());
            for peer in &arm.peers {
                let wanted = numbers(sample, peer);
                assert!(
                    off(&torques, &wanted) < 1e-10,
                    "{name}: {peer}: {torques:?}, {wanted:?}"
                );
                let found = forward.program.eval(&inputs(&wanted));
                let found = &found[model.joints..];
                // Where axes of a light wrist are in line, rounding of the torques moves it.
                let moved = off(found, &qdd);
                assert!(moved < 1e-7, "{name}: {peer}: {found:?}, {qdd:?}");
                let torques = inverse.eval(&[&inputs(&still), found].concat());
                assert!(
                    off(&torques, &wanted) < 1e-10,
                    "{name}: {peer}: {torques:?}"
                );
            }
        }
    }
}

/// Energy changes by the power of the torques, with a joint that follows another as well.
#[test]
fn energy_of_a_linkage_changes_by_the_power() {
    let model = model(&read_to(&fixture("linkage_4r.urdf"), Some("hand")));
    let (dynamics, energy) = (model.dynamics(), model.energy_program().unwrap());
    for point in crate::common::points(&dynamics, 100, 3) {
        let point = [&point[..13], &model.values()].concat();
        let (rates, energy) = (dynamics.program.eval(&point), energy.eval(&point));
        let parts: Vec<f64> = energy[2..].iter().zip(&rates).map(|(s, r)| s * r).collect();
        let size: f64 = parts.iter().map(|part| part.abs()).sum();
        let off = parts.iter().sum::<f64>() - energy[1];
        assert!(off.abs() <= 1e-12 * size, "{off:e} of {size}");
    }
}

/// A chain ends where it is told to; what hangs on it elsewhere moves with it.
#[test]
fn branches_are_welded_and_noted() {
    let file = fixture("linkage_4r.urdf");
    let whole = read_to(&file, Some("hand"));
    let note = "joint `left` is off the chain: `left_finger` is held where the file draws it";
    assert!(
        whole.notes.iter().any(|n| n.contains(note)),
        "{:?}",
        whole.notes
    );
    let slide = &whole.joints[3];
    assert!((slide.inertia.mass - 0.9).abs() < 1e-15);
    assert!(!whole.notes.iter().any(|n| n.contains("what acts on")));
    let short = read_to(&file, Some("slide"));
    assert_eq!(short.joints.len(), 4);
    assert!((short.joints[3].inertia.mass - 1.3).abs() < 1e-15);
    let said = refuses(&["new", "--from-urdf", text(&file)]);
    assert!(said.contains("`left_finger` and `hand` move"), "{said}");
    let said = refuses(&["new", "--from-urdf", text(&file), "--tip", "hant"]);
    assert!(
        said.contains("no body `hant`") && said.contains("`hand`"),
        "{said}"
    );
    let shown = succeeds(&["new", "--from-urdf", text(&file), "--tip", "hand"]);
    assert!(
        shown.contains("ratio = -0.8\noffset = 0.3\nslides = false"),
        "{shown}"
    );
}

/// Error of the torques of an arm as its URDF describes it, in per cent of the logged torques: on the rows of a log from this
/// share of them on.
fn error_of_torques(arm: &str, log: &str, from: f64) -> Option<f64> {
    let data = measured(arm)?;
    let folder = tempfile::tempdir().unwrap();
    let rows = fs::read_to_string(data.join(log)).unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let count = (rows.len() - 1) as f64;
    let first = 1 + rows.len().min((from * count) as usize);
    let [model, part] = ["model.toml", "part.csv"].map(|name| folder.path().join(name));
    fs::write(&part, [&rows[..1], &rows[first..]].concat().join("\n")).unwrap();
    let description = data.join(format!("{arm}.urdf"));
    succeeds(&[
        "new",
        "--from-urdf",
        text(&description),
        "--out",
        text(&model),
    ]);
    let (model, part) = (text(&model), text(&part));
    let horizon = ["--horizon", "0.02", "--torque", "--json"];
    let told = succeeds(
        &[
            &["evaluate", "--model", model, "--test", part],
            &horizon[..],
        ]
        .concat(),
    );
    let told: Value = serde_json::from_str(&told).unwrap();
    let joints = told["torque"]["rms"].as_array().unwrap().len();
    assert_eq!(joints, told["position_rmse"][0].as_array().unwrap().len());
    Some(100.0 * told["torque"]["relative"].as_f64().unwrap())
}

/// The same numbers by another program, from the READMEs of the data sets.
#[test]
fn torques_of_measured_arms_are_off_by_what_others_find() {
    for (arm, log, from, wanted) in [
        ("panda", "exciting_trajectory.csv", 0.7, 4.43),
        ("kuka_lwr4", "measurements_2.csv", 0.0, 9.67),
        ("ur10", "ur10_exciting_trajectory.csv", 0.65, 46.8),
    ] {
        let Some(found) = error_of_torques(arm, log, from) else {
            continue;
        };
        assert!((found / wanted - 1.0).abs() < 3e-3, "{arm}: {found} %");
    }
}

#[test]
fn torques_need_a_model_of_torques_and_a_log_of_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    let short = ["--duration", "0.9", "--out", text(&log)];
    succeeds(&[&["simulate", "--plant", "acrobot"], &short[..]].concat());
    let evaluate = |model: &str| {
        let test = ["--test", text(&log), "--horizon", "0.02", "--torque"];
        refuses(&[&["evaluate", "--model", model], &test[..]].concat())
    };
    let said = evaluate("acrobot");
    assert!(said.contains("longer than a second"), "{said}");
    let one = folder.path().join("one.csv");
    let short = ["--duration", "3", "--out", text(&one)];
    succeeds(&[&["simulate", "--plant", "pendulum"], &short[..]].concat());
    let test = ["--test", text(&one), "--torque"];
    let said = refuses(&[&["evaluate", "--model", "pendulum"], &test[..]].concat());
    assert!(said.contains("pendulum gives accelerations"), "{said}");
}
