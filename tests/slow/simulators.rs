//! Mechanisms exported for rigid-body simulators: simulated by MuJoCo, and read back.

use std::fs;
use std::path::Path;

use residyn_core::model::tree::model_text;
use residyn_core::model::{Library, Model};
use residyn_core::sim::Integrator;
use residyn_formats::{ExportModel, FORMATS, find};
use serde_json::json;

use crate::support::catalogue::{assert_near, points, rng};
use crate::support::mechanisms::{fixture, read, read_to};
use crate::support::predictions::{client_agrees, expected, predictions, written};
use crate::support::tables::{rows, says_words};
use crate::support::{exported_models, refuses, residyn, text};

/// An effect as in a model file.
fn effect(name: &str, joint: usize, values: &str) -> String {
    format!("\n[[effect]]\nname = \"{name}\"\njoint = {joint}\n{values}\n")
}

fn portable(name: &str, integrator: Integrator, effects: &[String]) -> ExportModel {
    let text = Library::system_text(name).unwrap().to_owned() + &effects.concat();
    of_text(&text, integrator)
}

fn of_text(text: &str, integrator: Integrator) -> ExportModel {
    let library = Library::built_in();
    let system = Model::from_text(Path::new("model.toml"), text, library.effects()).unwrap();
    ExportModel::of_system(&system, integrator, 0.01, json!({}))
}

/// Five bodies, each attached to the one before.
fn chain() -> ExportModel {
    let description = fs::read_to_string(fixture("linkage_4r.urdf")).unwrap();
    let mimics = |line: &&str| line.contains("<mimic");
    let lines: Vec<&str> = description.lines().filter(|line| !mimics(line)).collect();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("five.urdf");
    fs::write(&file, lines.join("\n")).unwrap();
    let text = model_text(&read_to(&file, Some("hand")));
    let system = Model::from_text(&file, &text, Library::built_in().effects()).unwrap();
    ExportModel::of_system(&system, Integrator::RK4, 0.002, json!({}))
}

/// Models that both formats carry: name, system, integrator, and effects with their joints and values.
const PLAIN: &str = "
pendulum              | pendulum | euler |
pendulum with effects | pendulum | rk4   | FRICTION@1; actuator_saturation@1: m = 2.0; gravity_tilt@1: delta = 0.3
drive                 | drive    | rk4   | FRICTION@1
acrobot               | acrobot  | fine  |
acrobot with effects  | acrobot  | rk4   | FRICTION@2; actuator_saturation@2: m = 5.0; gravity_tilt@1: delta = 0.3
cartpole              | cartpole | fine  |
cartpole with effects | cartpole | euler | FRICTION@1; FRICTION@2; actuator_saturation@1: m = 4.0
";

/// Models that only MJCF carries, compared step by step.
const DRIVEN: &str = "
servo with a gain | servo    | rk4 | actuator_gain@1: g = 0.3; SPRING@1
gain, then limit  | pendulum | rk4 | actuator_gain@1: g = 0.3; actuator_saturation@1: m = 3.0; SPRING@1
limit, then gain  | acrobot  | rk4 | actuator_saturation@2: m = 3.0; actuator_gain@2: g = 0.3; ROTOR@1; ROTOR@2
shifted servo     | servo    | rk4 | actuator_gain@1: g = 0.3; constant_torque@1: tau_0 = 0.2; sensor_offset@1: q_z = 0.1
late servo        | servo    | euler | actuator_delay@1: d = 0.025; actuator_gain@1: g = -0.2
late motor        | acrobot  | euler | actuator_delay@2: d = 0.02; actuator_saturation@2: m = 3.0
gain and offset   | cartpole | rk4 | constant_torque@1: tau_0 = -0.4; actuator_gain@1: g = 0.3; ROTOR@1; ROTOR@2; SPRING@2
";

/// Motors behind transmissions, whose steps are not those of MuJoCo: the derivative is compared.
const BEHIND: &str = "
elastic, link side    | pendulum | rk4 | joint_elasticity@1: k = 30,d = 0.2,J_m = 0.02,sensor = 0,friction = 0; FRICTION@1; SPRING@1
elastic, motor side   | pendulum | rk4 | joint_elasticity@1: k = 30,d = 0.2,J_m = 0.02,sensor = 1,friction = 1; FRICTION@1; actuator_gain@1: g = 0.3
elastic second joint  | acrobot  | rk4 | FRICTION@1; joint_elasticity@2: k = 80,d = 0.1,J_m = 0.05,sensor = 1,friction = 0; FRICTION@2
two elastic joints    | acrobot  | rk4 | joint_elasticity@1: k = 90,d = 0.3,J_m = 0.1,sensor = 0,friction = 1; FRICTION@1; joint_elasticity@2: k = 80,d = 0.1,J_m = 0.05,sensor = 1,friction = 0
";

/// The effects of a table's cell, as in a model file.
fn effects(cell: &str) -> Vec<String> {
    let parts = cell.split("; ").filter(|part| !part.is_empty());
    let part = |part: &str| {
        let (name, rest) = part.split_once('@').unwrap();
        let (joint, values) = rest.split_once(": ").unwrap_or((rest, ""));
        let joint = joint.parse().unwrap();
        match name {
            "FRICTION" => {
                let dry = effect("coulomb_friction", joint, "F_c = 0.1");
                dry + &effect("viscous_friction", joint, "b = 0.05")
            }
            "SPRING" => effect("joint_spring", joint, "k = 1.5\nq_0 = 0.2"),
            "ROTOR" => effect("rotor_inertia", joint, "J = 0.2"),
            name => effect(name, joint, &values.replace(',', "\n")),
        }
    };
    parts.map(part).collect()
}

fn models(table: &str) -> Vec<(String, ExportModel)> {
    let model = |[name, system, integrator, cell]: [String; 4]| {
        let integrator = match integrator.as_str() {
            "euler" => Integrator::SEMI_IMPLICIT_EULER,
            "rk4" => Integrator::RK4,
            _ => Integrator::fine(4.try_into().unwrap()),
        };
        (name, portable(&system, integrator, &effects(&cell)))
    };
    rows(table).into_iter().map(model).collect()
}

/// Models that both formats carry.
fn plain() -> Vec<(String, ExportModel)> {
    let mut all = models(PLAIN);
    all.push(("chain of five".to_owned(), chain()));
    all
}

/// Equations only, from which the mechanism has to be recovered.
fn stated() -> Vec<(&'static str, ExportModel)> {
    let stated = |slides: &str, mass: &[&[&str]], bias: &[&str]| {
        let text = format!(
            "[system]\nname = \"stated\"\njoints = {}\nprismatic = {slides}\n[dynamics]\nmass = {mass:?}\nbias = {bias:?}\n",
            bias.len()
        );
        of_text(&text, Integrator::RK4)
    };
    let lean = &["2*sin(q1) + 1.5*cos(q1) + 0.1*qd1"];
    let coupling = "0.9 + 0.4*cos(q2) + 0.1*sin(q2)";
    let own = "3 + 0.8*cos(q2) + 0.2*sin(q2)";
    let turning = &[
        "(0.1*cos(q2) - 0.4*sin(q2))*(2*qd1*qd2 + qd2^2) + 0.2*qd1",
        "(0.4*sin(q2) - 0.1*cos(q2))*qd1^2 + 0.3*qd2",
    ];
    let inclined = &["-4 - 0.3*sin(q2)*qd2^2", "-2.7*sin(q2) - 0.6*cos(q2)"];
    let arm = read(&fixture("planar_2r.urdf"));
    vec![
        ("leaning pendulum", stated("[]", &[&["0.7"]], lean)),
        ("inclined slide", stated("[1]", &[&["2"]], &["5 + 0.3*qd1"])),
        (
            "weightless arm with a rotor",
            stated("[]", &[&[own, coupling], &[coupling, "1.1"]], turning),
        ),
        (
            "cart with a pole on a slope",
            stated(
                "[1]",
                &[&["2", "0.3*cos(q2)"], &["0.3*cos(q2)", "0.2"]],
                inclined,
            ),
        ),
        ("arm from URDF", of_text(&model_text(&arm), Integrator::RK4)),
    ]
}

/// In steps of a tenth of a millisecond; those of ten are too long for MuJoCo to follow the springs.
#[test]
fn mujoco_moves_motors_behind_transmissions_as_the_model_does() {
    let format = find("mjcf").unwrap();
    for (name, mut model) in models(BEHIND) {
        model.step_s = 1e-4;
        let (_folder, path) = written(format, &name, &model);
        let (samples, own) = expected(&model);
        let Some(theirs) = predictions(&name, || format.predict(&path, &samples)) else {
            continue;
        };
        let off = own.difference(&theirs);
        assert!(off.derivative.unwrap() < 1e-9, "{name}: {off:?}");
        assert!(
            off.next.unwrap() < 1e-6 && off.rollout.unwrap() < 1e-3,
            "{name}: {off:?}"
        );
    }
}

#[test]
fn mujoco_integrates_written_mjcf_to_the_same_states() {
    client_agrees(find("mjcf").unwrap(), &plain());
    client_agrees(find("mjcf").unwrap(), &models(DRIVEN));
    client_agrees(find("mjcf").unwrap(), &stated());
}

#[test]
fn mujoco_integrates_written_urdf_to_the_same_states() {
    client_agrees(find("urdf").unwrap(), &plain());
}

#[test]
fn a_lag_has_the_same_derivative() {
    let lag = effect("actuator_lag", 1, "T = 0.05") + &effect("actuator_gain", 1, "g = -0.2");
    let model = portable("pendulum", Integrator::RK4, &[lag]);
    let format = find("mjcf").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.xml");
    format.write(&model, &path).unwrap();
    let samples = model.samples(&mut rng(1)).unwrap();
    let own = model.predict(&samples).unwrap();
    if let Some(theirs) = predictions("lag", || format.predict(&path, &samples)) {
        let difference = own.difference(&theirs);
        assert!(
            difference.derivative.unwrap() <= format.tolerance,
            "{difference:?}"
        );
        assert_eq!((difference.next, difference.rollout), (None, None));
    }
    let limits = (format.not_carried)(&model);
    assert!(limits[0].starts_with("the lag within a step"), "{limits:?}");
}

/// An effect on the servo, the integrator, and what its file says that MuJoCo does otherwise.
const TIMING: &str = "
actuator_delay@1: d = 0.025 | rk4   | commands that jump within a step
actuator_delay@1: d = 0.005 | euler | delays shorter than a step of 0.01 s ... export with a shorter one
actuator_lag@1: T = 0.05    | euler | the lag within a step
";

#[test]
fn delays_that_mujoco_has_otherwise_are_listed() {
    let said = |cell: &str, integrator: &str| {
        let [(_, model)] = &models(&format!("x | servo | {integrator} | {cell}"))[..] else {
            panic!("one model");
        };
        (find("mjcf").unwrap().not_carried)(model).join("\n")
    };
    for [cell, integrator, words] in rows(TIMING) {
        says_words(&said(&cell, &integrator), &words);
    }
    assert_eq!(said("actuator_delay@1: d = 0.025", "euler"), "");
}

#[test]
fn written_mechanisms_read_back_with_the_same_accelerations() {
    let library = Library::built_in();
    for (name, model) in plain() {
        let folder = tempfile::tempdir().unwrap();
        for format in FORMATS.iter().filter(|format| format.robots.is_some()) {
            let path = folder.path().join("model").with_extension(format.extension);
            format.write(&model, &path).unwrap();
            let mut chain = read(&path);
            let names = chain.joints.iter().map(|joint| &joint.name);
            assert!(
                names.zip(&model.system.joint_names).all(|(a, b)| a == b),
                "{name}"
            );
            // URDF does not state gravity.
            let down = chain.gravity.normalize();
            let own = model.declared().parameters;
            let own = own.iter().find(|p| p.unit == "m/s^2");
            chain.gravity = own.map_or(chain.gravity, |g| down * g.value);
            let text = model_text(&chain);
            let back = Model::from_text(Path::new(&name), &text, library.effects()).unwrap();
            let n = model.joints();
            let back = back.dynamics();
            for point in points(&back, 50, 1) {
                let moving = &point[..=3 * n];
                let [found, wanted] = [&back, &model.equations]
                    .map(|d| d.program.eval(&[moving, &d.values()].concat())[n]);
                assert_near(found, wanted, 1e-9, &format!("{name} as {}", format.name));
            }
        }
    }
}

#[test]
fn parts_that_are_not_carried_are_listed() {
    let rest = effect("stribeck_friction", 1, "F_c = 0.1\nF_s = 0.2\nv_s = 0.1")
        + &effect("rotor_inertia", 2, "J = 0.1")
        + &effect("actuator_gain", 2, "g = 0.5");
    let model = portable("acrobot", Integrator::RK4, &[rest]);
    let said = |format: &str| (find(format).unwrap().not_carried)(&model).join("\n");
    let (mjcf, urdf) = (said("mjcf"), said("urdf"));
    assert!(
        mjcf.starts_with("stribeck_friction on joint 1: its excess near standstill; dry friction of 0.1000 is written")
            && mjcf.lines().count() == 2,
        "{mjcf}"
    );
    for part in [
        "stribeck_friction",
        "gravity of 9.8 ",
        "rotor's inertia of joint 2",
        "gain of joint 2",
    ] {
        assert!(urdf.contains(part), "{part} is missing in {urdf}");
    }
}

#[test]
fn equations_of_no_mechanism_cannot_be_exported() {
    let all = exported_models::all();
    let (_, data) = all
        .iter()
        .find(|(name, _)| *name == "pendulum_data")
        .unwrap();
    let error = find("mjcf")
        .unwrap()
        .write(data, Path::new("no.xml"))
        .unwrap_err();
    assert!(
        error
            .to_string()
            .contains("a network replaces its equations"),
        "{error}"
    );
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("no.urdf");
    let rig =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/rigs/dfki_simple_pendulum_published.toml");
    let said = refuses(&[
        "export",
        "--model",
        text(&rig),
        "--format",
        "urdf",
        "--out",
        text(&out),
    ]);
    for part in [
        "not one of the known mechanisms",
        "declare its bodies in [chain]",
    ] {
        assert!(said.contains(part), "{part} is missing in {said}");
    }
    assert!(!out.exists());
}

#[test]
fn export_lists_losses_and_measures_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("cartpole.xml");
    let run = residyn(&[
        "export",
        "--model",
        "cartpole",
        "--format",
        "mjcf",
        "--out",
        text(&out),
    ]);
    assert_eq!(run.status.code(), Some(0));
    assert!(
        fs::read_to_string(&out)
            .unwrap()
            .contains("<joint name=\"joint1\" type=\"slide\" axis=\"1 0 0\"/>")
    );
}
