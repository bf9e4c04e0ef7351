//! Chains of many joints: their equations compared with those of Pinocchio and MuJoCo.

use std::fs;
use std::path::PathBuf;

use residyn::read_log;
use residyn_core::data::{Interval, Joint};
use residyn_core::identify::{LevenbergMarquardt, fit_torques};
use residyn_core::model::tree::Inertia;
use residyn_core::model::{FittedEffect, Library, Model};
use residyn_core::sim::metric::torque_error;
use serde::Deserialize;
use serde_json::Value;

use crate::support::arms::{as_built, model, moved};
use crate::support::catalogue::effect;
use crate::support::clients::client;
use crate::support::mechanisms::{fixture, read_to};
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, answers, measured, replaced, says, text};

/// Results of Pinocchio and MuJoCo for an arm.
#[derive(Deserialize)]
struct Arm {
    file: PathBuf,
    tip: Option<String>,
    joints: Vec<String>,
    peers: Vec<String>,
    samples: Vec<Value>,
}

fn numbers(sample: &Value, key: &str) -> Vec<f64> {
    serde_json::from_value(sample[key].clone()).unwrap()
}

/// Largest difference, relative to the largest of the wanted numbers.
fn off(found: &[f64], wanted: &[f64]) -> f64 {
    let differences = found.iter().zip(wanted).map(|(a, b)| (a - b).abs());
    let size = wanted.iter().map(|x| x.abs()).fold(0.0, f64::max);
    differences.fold(0.0, f64::max) / size
}

/// A model ends at the requested link; bodies attached elsewhere move with it.
#[test]
fn branches_are_welded_and_noted() {
    let file = fixture("linkage_4r.urdf");
    let whole = read_to(&file, Some("hand"));
    let note =
        "joint `left` is not on the way to the tip: `left_finger` is held where the file draws it";
    assert!(
        whole.notes.iter().any(|n| n.contains(note)),
        "{:?}",
        whole.notes
    );
    let slide = &whole.joints[3];
    assert!((slide.inertia.mass - 0.9).abs() < 1e-15);
    assert!(!whole.notes.iter().any(|n| n.contains("what acts on")));
    // The effects of a joint that is left out do not matter.
    let scratch = Scratch::new();
    let description = fs::read_to_string(&file).unwrap();
    let left = |kind: &str| format!("<joint name=\"left\" type=\"{kind}\">");
    let odd = replaced(&description, &left("prismatic"), &left("planar"));
    scratch.file("other.urdf", odd);
    let other = read_to(&scratch.path("other.urdf"), Some("hand"));
    assert_eq!(other.joints, whole.joints);
    let short = read_to(&file, Some("slide"));
    assert_eq!(short.joints.len(), 4);
    assert!((short.joints[3].inertia.mass - 1.3).abs() < 1e-15);
    let new = "new --from-urdf $REPO/tests/fixtures/mechanisms/linkage_4r.urdf";
    let all = read_to(&file, None);
    assert_eq!(all.joints.len(), whole.joints.len() + 1);
    assert!(all.notes.iter().all(|n| !n.contains("is held")));
    let said = scratch.refuses(&format!("{new} --tip hant"));
    says(&said, &["no body `hant`", "`hand`"]);
    let said = scratch.succeeds(&format!("{new} --tip hand"));
    says(&said, &["ratio = -0.8\noffset = 0.3\nslides = false"]);
}

/// Error of the torques of an arm as its URDF describes it, in per cent of the logged torques, on a log's rows from
/// this fraction on.
fn error_of_torques(arm: &str, log: &str, from: f64) -> Option<f64> {
    let data = measured(arm)?;
    let scratch = Scratch::new();
    let rows = fs::read_to_string(data.join(log)).unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let count = (rows.len() - 1) as f64;
    let first = 1 + rows.len().min((from * count) as usize);
    let part = [&rows[..1], &rows[first..]].concat().join("\n");
    scratch.file("part.csv", part);
    let model = scratch.new_model(&data.join(format!("{arm}.urdf")));
    let sampled = fs::read_to_string(&model).unwrap() + "\n[log]\ntorque = \"sampled\"\n";
    scratch.file("model.toml", sampled);
    let evaluate = "evaluate --model model.toml --test part.csv";
    let message = scratch.json(&format!("{evaluate} --horizon 0.02 --torque"));
    let joints = message["torque"]["rms"].as_array().unwrap().len();
    assert_eq!(
        joints,
        message["position_rmse"][0].as_array().unwrap().len()
    );
    Some(100.0 * message["torque"]["relative"].as_f64().unwrap())
}

/// The same numbers from another program, in the READMEs of the data sets.
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

/// Both logs follow the same reference.
#[test]
fn the_same_motion_of_a_measured_arm_is_reported() {
    let Some(data) = measured("kuka_lwr4") else {
        return;
    };
    let logs = ["measurements_1.csv", "measurements_2.csv"].map(|name| data.join(name));
    let scratch = Scratch::new();
    let model = scratch.new_model(&data.join("kuka_lwr4.urdf"));
    let audit = ["audit", "--model", &model, text(&logs[0]), text(&logs[1])];
    let repeats = "the motion repeats that of measurements_1.csv";
    says(&answers(&audit), &[repeats]);
}

/// A plant's log of some seconds, the command that asks for its torques, and words of the message.
const TORQUES: &str = "
acrobot  | 0.9 | evaluate --model acrobot --test acrobot.csv --horizon 0.02 --torque | longer than a second
pendulum | 3   | evaluate --model pendulum --test pendulum.csv --torque | pendulum gives accelerations
";

#[test]
fn torques_need_a_model_of_torques_and_a_log_of_a_second() {
    let scratch = Scratch::new();
    for [plant, seconds, line, words] in rows(TORQUES) {
        scratch.succeeds(&format!(
            "simulate --plant {plant} --duration {seconds} --out {plant}.csv"
        ));
        says_words(&scratch.refuses(&line), &words);
    }
}

/// Body parameters that are off by 10 to 20 % are recovered from torques, as far as the motion determines them,
/// together with friction; the others stay, and every body remains physical.
#[test]
fn torques_of_a_linkage_tell_its_bodies_and_its_friction() {
    let declared = model(&read_to(&fixture("linkage_4r.urdf"), Some("hand")));
    let friction = |level: f64| -> Vec<FittedEffect> {
        let of_joint = |j: usize| {
            let viscous = effect("viscous_friction", j, &[level]);
            [viscous, effect("coulomb_friction", j, &[2.0 * level])]
        };
        (0..4).flat_map(of_joint).collect()
    };
    let with = |level: f64| {
        declared
            .with_effects(friction(level))
            .with_smoothing_velocities(vec![0.02; 4])
    };
    let rig = as_built(&with(0.4));
    let [train, test] = [1, 2].map(|seed| vec![moved(&rig, 20.0, seed)]);
    let found = fit_torques(&LevenbergMarquardt::USUAL, &with(0.1), &declared, &train).unwrap();
    assert!(
        found.fit.termination.has_converged(),
        "{}",
        found.fit.termination
    );
    let error = |model: &Model| torque_error(model, &test).unwrap().relative;
    let [before, after, best] = [&with(0.4), &found.model, &rig].map(error);
    // The rig's own model has errors where friction reverses, since motion and torque are smoothed.
    assert!(
        before > 1.7 * best && after < 1.01 * best,
        "{before} {after} {best}"
    );
    for effect in &found.model.effects {
        let wanted = if effect.effect.name == "viscous_friction" {
            0.4
        } else {
            0.8
        };
        let value = effect.values[0].0;
        assert!(
            (value / wanted - 1.0).abs() < 0.05,
            "{}: {value}",
            effect.label()
        );
    }
    let body = |model: &Model, k: usize| {
        Inertia::of_parts(&model.inertias()[k].map(|p| model.parameters[p].value))
    };
    let total = |model: &Model| (1..5).map(|k| body(model, k).mass).sum::<f64>();
    assert!((total(&found.model) / total(&rig) - 1.0).abs() < 0.05);
    for k in 0..5 {
        let Inertia {
            mass,
            moment,
            tensor,
        } = body(&found.model, k);
        let centre = moment / mass;
        let shift =
            nalgebra::Matrix3::identity() * centre.dot(&centre) - centre * centre.transpose();
        let principal = (tensor - shift * mass).symmetric_eigenvalues();
        assert!(mass > 0.0 && principal.min() > 0.0, "{k}: {principal}");
        assert!(2.0 * principal.max() < principal.sum(), "{k}: {principal}");
    }
}

/// An arm, the log that is fitted and the one for the test, the time at which both begin, the share of the log that is
/// fitted, and the error by least squares on base parameters in per cent (figures in the READMEs of the data sets).
const MEASURED: &str = "
panda     | exciting_trajectory.csv      | exciting_trajectory.csv      | 0.0 | 0.7  | 1.59
kuka_lwr4 | measurements_1.csv           | measurements_2.csv           | 2.5 | 1.0  | 3.08
ur10      | ur10_exciting_trajectory.csv | ur10_exciting_trajectory.csv | 0.0 | 0.65 | 7.28
";

/// Fitted near its URDF's values, with the friction that every arm has, an arm's torques on the part of its log that
/// was not fitted are as accurate as by least squares on base parameters (figures in the READMEs of the data sets).
#[test]
fn fitted_torques_of_measured_arms_are_as_near_as_by_least_squares() {
    for [arm, train, test, numbers @ ..] in rows::<6>(MEASURED) {
        let [first_s, share, least_squares] = numbers.map(|number| number.parse::<f64>().unwrap());
        let Some(data) = measured(&arm) else {
            continue;
        };
        let declared = model(&read_to(&data.join(format!("{arm}.urdf")), None));
        let log = |name: &str| read_log(data.join(name), &declared).unwrap();
        let [mut train, mut test] = [log(&train), log(&test)];
        let split_s = train.time[((train.rows() - 1) as f64 * share) as usize];
        let span = |start_s: f64, end_s: f64| Interval { start_s, end_s };
        train.leave_out = vec![span(-1.0, first_s)];
        test.leave_out = vec![span(-1.0, first_s)];
        if share < 1.0 {
            // Half a second at the ends of either part is left out.
            train.leave_out.push(span(split_s - 0.5, f64::INFINITY));
            test.leave_out.push(span(-1.0, split_s + 0.5));
        }
        let names = ["viscous_friction", "coulomb_friction", "constant_torque"];
        let library = Library::built_in();
        let of_joint = |joint: Joint| {
            let absent = |name| FittedEffect::absent(library.effect(name).unwrap(), joint);
            names.map(absent)
        };
        let effects: Vec<FittedEffect> = Joint::all(declared.joints).flat_map(of_joint).collect();
        let widths = vec![0.02; declared.joints];
        let with = declared
            .with_effects(effects)
            .with_smoothing_velocities(widths);
        let found = fit_torques(&LevenbergMarquardt::USUAL, &with, &declared, &[train])
            .unwrap()
            .model;
        let error = 100.0 * torque_error(&found, &[test]).unwrap().relative;
        assert!(
            error < least_squares,
            "{arm}: {error} %, least squares {least_squares} %"
        );
    }
}

mod slow {
    use super::*;

    #[test]
    fn pinocchio_and_mujoco_find_the_same_torques_and_accelerations() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("arms.json");
        client("arms.py", &[fixture("").as_path(), &file]);
        let Ok(message) = fs::read_to_string(&file) else {
            return;
        };
        let arms: Vec<Arm> = serde_json::from_str(&message).unwrap();
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
            let (inverse, forward) = (model.torque_balance().unwrap(), model.dynamics());
            let [values, still] = [model.values(), vec![0.0; model.joints]];
            for sample in &arm.samples {
                let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| numbers(sample, key));
                let inputs = |tau: &[f64]| [&q, &qd, tau, &[0.0], &values].concat();
                let needed = |qdd: &[f64]| {
                    let inputs = [&inputs(&still)[..3 * model.joints + 1], qdd, &values].concat();
                    inverse.program.eval(&inputs)
                };
                let torques = needed(&qdd);
                for peer in &arm.peers {
                    let wanted = numbers(sample, peer);
                    assert!(
                        off(&torques, &wanted) < 1e-10,
                        "{name}: {peer}: {torques:?}, {wanted:?}"
                    );
                    let found = forward.program.eval(&inputs(&wanted));
                    let found = &found[model.joints..];
                    // Where axes of a light wrist align, rounding of the torques changes it.
                    let moved = off(found, &qdd);
                    assert!(moved < 1e-7, "{name}: {peer}: {found:?}, {qdd:?}");
                    let torques = needed(found);
                    assert!(
                        off(&torques, &wanted) < 1e-10,
                        "{name}: {peer}: {torques:?}"
                    );
                }
            }
        }
    }
}
