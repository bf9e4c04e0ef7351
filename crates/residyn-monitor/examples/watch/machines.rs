//! Simulated machines: pieces of a log, each with its own state of wear, one after the other.

use crate::Rows;
use nalgebra::{Matrix3, Vector3};
use residyn_core::data::{Joint, Log};
use residyn_core::model::tree::{Drivetrain, Inertia, Pose, Servo, Tree, model_text, turn};
use residyn_core::model::{Library, Model};
use residyn_core::plant::{Excitation, Plant};
use residyn_core::rng;

/// Rows per second.
pub const RATE_HZ: f64 = 100.0;

/// A joint under torque that hangs, with viscous and dry friction.
pub fn joint() -> Plant {
    let text = "[system]\nname = \"joint\"\njoints = 1\n[parameters]\n\
        J = { value = 0.05, unit = \"kg m^2\", positive = true, fixed = true }\n\
        G = { value = 1.0, unit = \"N m\", positive = true }\n\
        [dynamics]\nmass = [[\"J\"]]\nbias = [\"G*sin(q1)\"]\n\
        [[effect]]\nname = \"viscous_friction\"\njoint = 1\nb = 0.05\n\
        [[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = 0.1\n";
    plant("joint.toml", text, vec![1.0])
}

/// Two links under torque, with viscous and dry friction on both joints.
pub fn arm() -> Plant {
    let friction = |joint: usize, b: f64, level: f64| {
        format!(
            "[[effect]]\nname = \"viscous_friction\"\njoint = {joint}\nb = {b}\n\
             [[effect]]\nname = \"coulomb_friction\"\njoint = {joint}\nF_c = {level}\n"
        )
    };
    let declared = Library::built_in()
        .model("acrobot")
        .expect("a built-in system")
        .text;
    let text = declared + &friction(1, 1.5, 1.0) + &friction(2, 0.8, 0.6);
    plant("arm.toml", &text, vec![9.0, 4.0])
}

/// Links one behind the other under position loops of known gains, as a tree of bodies: friction on every joint.
pub fn servo_arm(joints: usize) -> Plant {
    let link = |k: usize| {
        let length = 0.3;
        let size = 1.0 - 0.1 * k as f64;
        let across = if k.is_multiple_of(2) { 0.5 } else { -0.5 };
        residyn_core::model::tree::Joint {
            name: format!("joint_{}", k + 1),
            body: format!("link_{}", k + 1),
            parent: k.checked_sub(1),
            slides: false,
            pose: Pose {
                rotation: match k {
                    0 => turn(Vector3::x(), std::f64::consts::FRAC_PI_2),
                    _ => turn(Vector3::x(), std::f64::consts::PI * across),
                },
                origin: if k == 0 {
                    Vector3::zeros()
                } else {
                    Vector3::new(length, 0.0, 0.0)
                },
            },
            reference: 0.0,
            across: Vector3::x(),
            axis: Vector3::z(),
            anchor: Vector3::zeros(),
            inertia: Inertia::central(
                3.0 * size,
                Matrix3::from_diagonal(&Vector3::new(0.005, 0.03, 0.03)) * size,
                &Pose {
                    rotation: Matrix3::identity(),
                    origin: Vector3::new(0.5 * length, 0.01, 0.01),
                },
            ),
            follows: None,
            drivetrain: Drivetrain {
                damping: 1.0 * size,
                friction: 1.0 * size,
                servo: Some(Servo {
                    stiffness: 300.0,
                    damping: 20.0,
                    is_known: true,
                }),
                ..Drivetrain::default()
            },
        }
    };
    let tree = Tree {
        name: format!("servo_arm_{joints}"),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        joints: (0..joints).map(link).collect(),
        drive: None,
        notes: Vec::new(),
    };
    plant("servo_arm.toml", &model_text(&tree), vec![0.8; joints])
}

fn plant(name: &str, text: &str, amplitude: Vec<f64>) -> Plant {
    let library = Library::built_in();
    let model = library.model_from_text(name, text).expect("a model");
    let mut plant = Plant::of_system(model);
    plant.sensor.rate_hz = RATE_HZ;
    plant.sensor.position_noise = 2e-4;
    plant.excitation = Excitation {
        amplitude,
        band_hz: [0.1, 1.0],
        tones: 8,
    };
    plant
}

/// The plant with another value of an effect's first parameter.
pub fn with_effect(
    mut plant: Plant,
    name: &str,
    joint: usize,
    change: impl Fn(f64) -> f64,
) -> Plant {
    let mut effects = plant.effects.iter_mut();
    let effect = effects.find(|own| own.effect.name == name && own.joint == Joint::at(joint));
    let value = &mut effect.expect("the plant has it").values[0].0;
    *value = change(*value);
    plant
}

/// The plant with one more effect.
pub fn adding(mut plant: Plant, name: &str, joint: usize, values: &[(&str, f64)]) -> Plant {
    let values: Vec<(String, f64)> = values
        .iter()
        .map(|(name, value)| ((*name).to_owned(), *value))
        .collect();
    let added = plant.add_effect(&Library::built_in(), name, Joint::at(joint), &values);
    added.expect("the plant can have it");
    plant
}

/// The model that a plant was made of.
pub fn model(plant: &Plant) -> Model {
    plant.system.clone()
}

/// A stretch of the machine's life, at a time (s) of the watch.
pub fn piece(plant: &Plant, at_s: f64, duration_s: f64, seed: u64) -> Rows {
    let mut plant = plant.clone();
    plant.recording.duration_s = duration_s;
    let log: Log = plant.record(&mut rng(seed)).expect("a stable plant");
    let mut rows = Rows::of_log(&log, []).expect("a log without further columns");
    rows.time.iter_mut().for_each(|time| *time += at_s);
    rows
}
