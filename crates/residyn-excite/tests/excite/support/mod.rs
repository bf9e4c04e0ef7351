//! Rigs for tests: built-in systems, arms of the bench, chains of any number of joints, and what they may do.

#![allow(dead_code)] // each test uses some of it

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use residyn_core::data::Joint;
use residyn_core::model::tree::{self, Drivetrain, Inertia, Pose, Tree, with_z_along};
use residyn_core::model::{FittedEffect, Library, Model};
use residyn_excite::{JointLimits, Limits};

/// A built-in system, or a model file below the root of the project.
pub fn model(name: &str) -> Model {
    let library = Library::built_in();
    if Path::new(name).extension().is_none() {
        return library.model(name).unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(name);
    let text = std::fs::read_to_string(path).unwrap();
    library.model_from_text(name, &text).unwrap()
}

/// An arm whose joints turn about changing axes, its links getting lighter.
pub fn chain(joints: usize) -> Model {
    let axes = [Vector3::z(), Vector3::y(), Vector3::x(), Vector3::y()];
    let link = |k: usize| {
        let mass = 4.0 * 0.75_f64.powi(k as i32);
        let centre = Vector3::new(0.02, 0.03, 0.08);
        let about_centre = Matrix3::from_diagonal(&Vector3::new(0.012, 0.011, 0.004)) * mass;
        let shift = Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
        tree::Joint {
            name: format!("joint{}", k + 1),
            body: format!("link{}", k + 1),
            parent: k.checked_sub(1),
            slides: false,
            pose: Pose {
                rotation: with_z_along(axes[k % 4]),
                origin: Vector3::new(0.0, 0.05, if k == 0 { 0.0 } else { 0.2 }),
            },
            reference: 0.0,
            across: Vector3::x(),
            axis: Vector3::z(),
            anchor: Vector3::zeros(),
            inertia: Inertia {
                mass,
                moment: centre * mass,
                tensor: about_centre + shift * mass,
            },
            follows: None,
            drivetrain: Drivetrain::default(),
        }
    };
    let tree = Tree {
        name: format!("chain_of_{joints}"),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        joints: (0..joints).map(link).collect(),
        drive: None,
        notes: Vec::new(),
    };
    let text = tree::model_text(&tree);
    Library::built_in()
        .model_from_text("chain.toml", &text)
        .unwrap()
}

/// An effect of the library on a joint (counted from 1) with these values.
pub fn effect(name: &str, joint: usize, values: &[f64]) -> FittedEffect {
    let library = Library::built_in();
    let mut effect = FittedEffect::absent(library.effect(name).unwrap(), Joint::at(joint - 1));
    for (own, value) in effect.values.iter_mut().zip(values) {
        own.0 = *value;
    }
    effect
}

/// The model with one more effect.
pub fn with(model: &Model, more: FittedEffect) -> Model {
    let mut effects = model.effects.clone();
    effects.push(more);
    model.with_effects(effects)
}

/// One joint, with torques for what it carries.
pub fn joint(range: [f64; 2], torque: f64) -> JointLimits {
    JointLimits {
        angle: range,
        speed: 2.0,
        acceleration: 10.0,
        torque: Some(torque),
        torque_rate: Some(20.0 * torque),
        command: None,
        command_rate: None,
        start: None,
        torque_noise: 0.01 * torque,
        encoder_noise: 2e-4,
    }
}

pub fn limits(joints: Vec<JointLimits>) -> Limits {
    Limits {
        step_s: 0.01,
        joints,
        spheres: Vec::new(),
        boxes: Vec::new(),
    }
}

/// Limits of an arm whose torques fall from the base to the tip.
pub fn arm_limits(joints: usize, most: f64) -> Limits {
    let of = |k: usize| joint([-2.0, 2.0], most * 0.62_f64.powi(k as i32));
    limits((0..joints).map(of).collect())
}
