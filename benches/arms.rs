//! Inverse and forward dynamics of chains of bodies: one state at a time, and states side by side in vector lanes, on one core.
//! `benches/arms` compares the arm of seven joints with Pinocchio and MuJoCo.
//!
//! Prints one JSON object per measurement: what was computed, for how many joints, in how many lanes of which number
//! type, and the nanoseconds per state.

use std::path::Path;
use std::time::Instant;

use nalgebra::{Matrix3, Vector3};
use residyn::read_model;
use residyn_core::expr::Program;
use residyn_core::lanes::{Element, Row};
use residyn_core::model::tree::{Drivetrain, Inertia, Joint, Pose, Tree, model_text};
use residyn_core::model::{Library, Model};

/// Each time is the best of this many runs.
const REPEATS: usize = 7;
/// States per measurement.
const STATES: usize = 200_000;

/// Revolute joints about perpendicular axes, each link a rod.
fn chain(joints: usize) -> Model {
    let joint = |k: usize| Joint {
        name: format!("joint{}", k + 1),
        body: format!("link{}", k + 1),
        parent: k.checked_sub(1),
        slides: false,
        pose: Pose {
            // Quarter turns, now about x and now back.
            rotation: match k % 2 {
                0 => Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
                _ => Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0),
            },
            origin: Vector3::new(0.05, 0.0, 0.2),
        },
        reference: 0.0,
        across: Vector3::x(),
        axis: Vector3::z(),
        anchor: Vector3::zeros(),
        inertia: Inertia::central(
            1.5,
            Matrix3::from_diagonal(&Vector3::new(0.008, 0.009, 0.003)),
            &Pose {
                rotation: Matrix3::identity(),
                origin: Vector3::new(0.02, 0.01, 0.1),
            },
        ),
        follows: None,
        drivetrain: Drivetrain::default(),
    };
    let chain = Tree {
        name: format!("chain of {joints}"),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        joints: (0..joints).map(joint).collect(),
        drive: None,
        notes: Vec::new(),
    };
    let library = Library::built_in();
    let text = model_text(&chain);
    Model::from_text(Path::new("chain.toml"), &text, library.effects()).expect("a chain")
}

/// Nanoseconds per state; inputs from `held` on are parameters with these values.
fn nanoseconds<T: Element, const W: usize>(program: &Program, held: usize, values: &[f64]) -> f64 {
    let number = |x: f64| T::from_f64(x).expect("a number");
    let values: Vec<T> = values.iter().map(|value| number(*value)).collect();
    let mut tape = program.tape_at::<T, W>(held, &values);
    let rounds = STATES / W;
    let mut best = f64::INFINITY;
    for _ in 0..REPEATS {
        let begun = Instant::now();
        for round in 0..rounds {
            for (k, slot) in tape.moving().iter_mut().enumerate() {
                *slot = Row::splat(number(0.3 + 0.1 * k as f64 + 1e-6 * round as f64));
            }
            tape.run();
            std::hint::black_box(tape.output(0)[0]);
        }
        best = best.min(begun.elapsed().as_secs_f64() / (rounds * W) as f64);
    }
    1e9 * best
}

fn tell(model: &Model, called: &serde_json::Value) {
    let joints = model.joints;
    let inverse = model.torque_balance().expect("a chain has torques");
    let forward = model.dynamics();
    for (what, dynamics, held) in [
        ("inverse", &inverse, 4 * joints + 1),
        ("forward", &forward, 3 * joints + 1),
    ] {
        let (program, values) = (&dynamics.program, dynamics.values());
        let measured = [
            (1, "f64", nanoseconds::<f64, 1>(program, held, &values)),
            (8, "f64", nanoseconds::<f64, 8>(program, held, &values)),
            (16, "f32", nanoseconds::<f32, 16>(program, held, &values)),
        ];
        for (lanes, kind, ns) in measured {
            let line = serde_json::json!({"what": what, "joints": called, "lanes": lanes, "numbers": kind, "ns": ns});
            println!("{line}");
        }
    }
}

fn main() {
    for joints in [1, 2, 3, 6, 7, 12] {
        tell(&chain(joints), &joints.into());
    }
    let arm = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../configs/bench/arm-seven.toml"
    );
    let arm = read_model(arm, &Library::built_in()).expect("the arm of the bench");
    tell(&arm, &"arm".into());
}
