//! Every effect against a definition written by hand, with the exact sign.

use rand::RngExt;
use residyn_core::data::Joint;
use residyn_core::expr::SignForm;
use residyn_core::model::{Effect, FittedEffect, Library};
use residyn_validation::laws::{At, DRY, Law, SMOOTH};

use crate::support::arms;
use crate::support::catalogue::{
    assert_all_near, assert_near, dynamics, effect, fitted, library_with_user_effect, points, rng,
    system,
};
use crate::support::mechanisms::{fixture, read_to};
use crate::support::oracles::ORACLES;

/// As for the systems: rounding of a few dozen operations.
const ROUNDING: f64 = 1e-12;

/// The torque that reaches the equations of motion, from the effect's parameters and q, v, tau of its joint.
type Meaning = fn(&[f64], f64, f64, f64) -> f64;

/// Effects of kind torque, and a gear, which bears nothing at rest. Other forces are the laws by which the benches simulate
/// them.
const MEANINGS: [(&str, Meaning); 5] = [
    ("gear_friction", |p, _, v, tau| match tau * v {
        driving if driving > 0.0 => tau - p[0] * tau,
        driven if driven < 0.0 => tau + p[1] * tau,
        _ => tau,
    }),
    ("actuator_gain", |p, _, _, tau| (1.0 + p[0]) * tau),
    ("actuator_deadzone", |p, _, _, tau| match tau {
        tau if tau > p[0] => tau - p[0],
        tau if tau < -p[0] => tau + p[0],
        _ => 0.0,
    }),
    ("actuator_saturation", |p, _, _, tau| match tau {
        tau if tau > p[0] => p[0],
        tau if tau < -p[0] => -p[0],
        tau => tau,
    }),
    ("torque_speed_limit", |p, _, v, tau| {
        let limit = (p[0] * (1.0 - v.abs() / p[1])).max(0.0);
        tau.abs().min(limit).copysign(tau)
    }),
];

/// The torque that reaches the equations of motion of a joint under an effect of kind force or torque with these
/// parameters; `None` if it is of another kind.
fn meaning(effect: &Effect, own: &[f64], [q, v, tau]: [f64; 3]) -> Option<f64> {
    if let Some((_, meaning)) = MEANINGS.iter().find(|(name, _)| *name == effect.name) {
        return Some(meaning(own, q, v, tau));
    }
    let named = |name: &str| effect.parameters.iter().position(|p| p.name == name);
    let mut number = |name: &str| Ok(own[named(name).expect("a parameter of the effect")]);
    let [smooth, dry] =
        [SMOOTH, DRY].map(|table| Law::of(table, &effect.name, &mut number).unwrap());
    if smooth.is_none() && dry.is_none() {
        return None;
    }
    let added = |direction: f64| {
        let (load, t) = (tau, 0.0);
        let at = At {
            q,
            v,
            t,
            load,
            direction,
        };
        let [smooth, dry] = [&smooth, &dry].map(|law| law.as_ref().map_or(0.0, |law| law.at(at)));
        smooth - direction * dry
    };
    Some(match v {
        v if v > 0.0 => tau + added(1.0),
        v if v < 0.0 => tau + added(-1.0),
        // Halfway between the two, since the sign of zero is zero.
        _ => tau + 0.5 * (added(1.0) + added(-1.0)),
    })
}

/// Effect parameters within half of their typical values.
fn values(effect: &Effect, seed: u64) -> Vec<f64> {
    let mut rng = rng(seed);
    let typical = effect.parameters.iter().map(|p| p.typical);
    typical.map(|t| t * rng.random_range(0.5..1.5)).collect()
}

/// Random points, and each of them at rest, at a small torque and with a joint turned backwards.
fn points_and_edges(model: &residyn_core::model::Dynamics, joint: usize) -> Vec<Vec<f64>> {
    let n = model.joints;
    let plain = points(model, 40, 3);
    let with = |k: usize, value: f64| {
        plain.iter().map(move |point| {
            let mut point = point.clone();
            point[k] = value;
            point
        })
    };
    let edges = with(n + joint, 0.0)
        .chain(with(2 * n + joint, 0.01))
        .chain(with(joint, -1.2));
    plain.iter().cloned().chain(edges).collect()
}

#[test]
fn force_and_torque_effects_match_their_formulas() {
    let library = Library::built_in();
    let has_meaning = |effect: &&Effect| meaning(effect, &values(effect, 7), [0.0; 3]).is_some();
    for effect in library.effects().iter().filter(has_meaning) {
        let name = &effect.name;
        for (system_name, oracle) in ORACLES {
            let system = system(system_name);
            for joint in 0..system.joints {
                let own = values(effect, 7);
                let model = dynamics(&system, &[fitted(effect, joint, &own)], SignForm::Exact);
                let n = system.joints;
                for mut point in points_and_edges(&model, joint) {
                    let end = point.len() - own.len();
                    point[end..].copy_from_slice(&own);
                    let found = model.program.eval(&point);
                    let (q, v, tau) = (point[joint], point[n + joint], point[2 * n + joint]);
                    let mut bare = point[..end].to_vec();
                    bare[2 * n + joint] = meaning(effect, &own, [q, v, tau]).unwrap();
                    let what = format!("{name} on joint {} of {system_name}", Joint::at(joint));
                    assert_all_near(&found[n..], &oracle(&bare), ROUNDING, &what);
                }
            }
        }
    }
}

#[test]
fn friction_opposes_the_motion() {
    let library = Library::built_in();
    let drive = system("drive");
    let frictions = [
        "viscous_friction",
        "coulomb_friction",
        "stribeck_friction",
        "degressive_friction",
        "asymmetric_friction",
        "quadratic_drag",
        "load_friction",
        "gear_friction",
        "angle_friction",
    ];
    for name in frictions {
        let effect = library.effect(name).unwrap();
        let effect = fitted(effect, 0, &values(effect, 1));
        let model = dynamics(&drive, &[effect], SignForm::Exact);
        for (v, tau) in [(1.5, 1.0), (-1.5, 1.0), (0.2, -1.0), (-0.2, -1.0)] {
            let inputs = [&[0.3, v, tau, 0.0], model.values().as_slice()].concat();
            // The drive has a mass of 1: acceleration minus torque is the friction force.
            let friction = model.program.eval(&inputs)[1] - tau;
            assert!(friction * v < 0.0, "{name}: {friction} at speed {v}");
        }
    }
}

#[test]
fn a_tilt_turns_gravity() {
    let tilted = |name: &str| {
        let tilt = effect("gravity_tilt", 0, &[0.03]);
        dynamics(&system(name), &[tilt], SignForm::Exact)
    };
    let pendulum = tilted("pendulum");
    for point in points(&pendulum, 100, 5) {
        let [q, _, tau, _, c_g, c_i, delta] = point[..].try_into().unwrap();
        let wanted = c_g * (q + delta).sin() + c_i * tau;
        let found = pendulum.program.eval(&point)[1];
        assert_near(found, wanted, ROUNDING, "pendulum");
    }
    // In a chain, all angles count from the first link's: a tilt there tilts every link.
    let acrobot = tilted("acrobot");
    for point in points(&acrobot, 100, 5) {
        let (delta, bare) = point.split_last().unwrap();
        let mut turned = bare.to_vec();
        turned[0] += delta;
        let found = acrobot.program.eval(&point);
        assert_all_near(&found[2..], &ORACLES[1].1(&turned), ROUNDING, "acrobot");
    }
}

/// In logged angles: the logged angle minus the offset behaves as the rig's true angle.
#[test]
fn a_sensor_offset_shifts_the_measured_angle_alone() {
    let others = [
        effect("gravity_tilt", 0, &[0.03]),
        effect("joint_spring", 0, &[0.4, 0.5]),
        effect("cogging_torque", 0, &[0.1, 7.0, 0.3]),
    ];
    let offset = effect("sensor_offset", 0, &[0.02]);
    let system = system("pendulum");
    let bare = dynamics(&system, &others, SignForm::Exact);
    for place in 0..=others.len() {
        let mut effects = others.to_vec();
        effects.insert(place, offset.clone());
        let read = dynamics(&system, &effects, SignForm::Exact);
        for point in points(&read, 50, 9) {
            let mut parameters = read.parameters.iter();
            let at = parameters.position(|p| p.name == "q_z1").unwrap();
            let mut own = point.clone();
            own[0] -= own.remove(4 + at);
            let (found, wanted) = (read.program.eval(&point), bare.program.eval(&own));
            assert_near(found[1], wanted[1], ROUNDING, "pendulum");
        }
    }
}

/// M(q) qdd = tau - bias: unit torques reveal the mass matrix's columns, so the rotor's inertia is tested by the torque
/// that would turn it.
#[test]
fn a_rotor_adds_to_its_own_joint_alone() {
    let library = Library::built_in();
    let rotor = library.effect("rotor_inertia").unwrap();
    for (name, oracle) in ORACLES
        .into_iter()
        .filter(|(name, _)| system(name).has_mass_matrix())
    {
        let system = system(name);
        let n = system.joints;
        for joint in 0..n {
            let model = dynamics(&system, &[fitted(rotor, joint, &[0.2])], SignForm::Exact);
            for point in points(&model, 100, 6) {
                let found = model.program.eval(&point);
                let (inertia, bare) = point.split_last().unwrap();
                // The bare rig, driven by the torque that remains after turning the rotor, moves the same way.
                let mut left = bare.to_vec();
                left[2 * n + joint] -= inertia * found[n + joint];
                assert_all_near(&found[n..], &oracle(&left), ROUNDING, name);
            }
        }
    }
}

/// The motor turns with both joints: the torque of its friction and its rotor is subtracted from the first joint's, and
/// r times that torque from the second's.
#[test]
fn a_coupled_motor_takes_from_both_joints() {
    let library = Library::built_in();
    let coupling = library.effect("joint_coupling").unwrap();
    let (name, oracle) = ORACLES[1];
    assert_eq!(name, "acrobot");
    let system = system(name);
    assert!(system.can_carry(coupling, Joint::at(1)).is_err());
    for ratio in [1.0, -1.0, 0.3] {
        let [level, viscous, inertia] = [0.4, 0.3, 0.2];
        let effect = fitted(coupling, 0, &[level, viscous, inertia, ratio]);
        assert_eq!(effect.label(), "joint_coupling on joint 1 with 2");
        let model = dynamics(&system, &[effect], SignForm::Exact);
        for mut point in points(&model, 100, 6) {
            let end = point.len() - 4;
            point[end..].copy_from_slice(&[level, viscous, inertia, ratio]);
            let found = model.program.eval(&point);
            let sum = |of: &[f64]| of[0] + ratio * of[1];
            let (speed, acceleration) = (sum(&point[2..4]), sum(&found[2..]));
            let taken = level * speed.signum() + viscous * speed + inertia * acceleration;
            let mut left = point[..end].to_vec();
            left[4] -= taken;
            left[5] -= ratio * taken;
            assert_all_near(&found[2..], &oracle(&left), ROUNDING, name);
        }
    }
}

/// A point mass m changes the last body's inertia by the parallel axis theorem.
#[test]
fn a_payload_is_part_of_the_last_body() {
    let library = Library::built_in();
    let payload = library.effect("payload").unwrap();
    let arm = arms::model(&read_to(&fixture("linkage_4r.urdf"), Some("hand")));
    assert!(arm.can_carry(payload, Joint::at(2)).is_err());
    let [m, x, y, z] = [1.3, 0.1, -0.2, 0.15];
    let loaded = arm.with_effects(vec![fitted(payload, 3, &[m, x, y, z])]);
    let mut heavier = arm.clone();
    let parts = [
        m,
        m * x,
        m * y,
        m * z,
        m * (y * y + z * z),
        -m * x * y,
        -m * x * z,
    ];
    let parts = parts
        .into_iter()
        .chain([m * (x * x + z * z), -m * y * z, m * (x * x + y * y)]);
    for (place, more) in arm.inertias().pop().unwrap().into_iter().zip(parts) {
        heavier.parameters[place].value += more;
    }
    let [loaded, heavier] = [&loaded, &heavier].map(|model| model.dynamics());
    for point in points(&arm.dynamics(), 50, 6) {
        let [found, wanted] = [&loaded, &heavier].map(|d| {
            d.program
                .eval(&[&point[..13], d.values().as_slice()].concat())
        });
        assert_all_near(&found, &wanted, 1e-9, "accelerations");
    }
}

#[test]
fn torque_effects_come_before_forces_and_in_their_order() {
    let load = &effect("load_friction", 0, &[0.2]);
    let gain = &effect("actuator_gain", 0, &[0.5]);
    let limit = &effect("actuator_saturation", 0, &[1.2]);
    let offset = &effect("constant_torque", 0, &[0.3]);
    let drive = system("drive");
    let is = |effects: [&FittedEffect; 2], tau: f64, wanted: f64, what: &str| {
        let model = dynamics(&drive, &effects.map(Clone::clone), SignForm::Exact);
        let inputs = [&[0.0, 1.0, tau, 0.0], model.values().as_slice()].concat();
        assert_near(model.program.eval(&inputs)[1], wanted, ROUNDING, what);
    };
    // Torque that is added is not amplified.
    is([offset, gain], 1.0, 1.5 + 0.3, "offset");
    // The gear sees 1.5 N m for a commanded 1 N m, wherever the friction stands in the list.
    is([load, gain], 1.0, 1.5 - 0.2 * 1.5, "load");
    is([gain, load], 1.0, 1.5 - 0.2 * 1.5, "load");
    is([gain, limit], 1.0, 1.2, "gain, then limit");
    is([limit, gain], 1.4, 1.8, "limit, then gain");
}

#[test]
fn every_effect_file_is_tested_here() {
    // Effects with states are tested in internal_states.rs, with memory and of the sensor in memory.rs; a tilt, a rotor, a coupling, a payload and
    // an offset above.
    let elsewhere = [
        "gravity_tilt",
        "joint_coupling",
        "payload",
        "rotor_inertia",
        "encoder_eccentricity",
        "sensor_offset",
        "actuator_delay",
        "actuator_lag",
        "backlash",
        "joint_compliance",
        "presliding",
        "lugre_friction",
        "thermal_friction",
        "winding_heat",
        "cable_hysteresis",
        "joint_elasticity",
        "motor_backlash",
    ];
    for effect in Library::built_in().effects() {
        let is_here = meaning(effect, &values(effect, 7), [0.0; 3]).is_some();
        let is_elsewhere = elsewhere.contains(&effect.name.as_str());
        assert!(is_here != is_elsewhere, "{}", effect.name);
    }
}

#[test]
fn an_effect_of_a_users_folder_acts() {
    let library = library_with_user_effect();
    let brake = fitted(library.effect("eddy_brake").unwrap(), 0, &[0.3, 2.0]);
    let model = dynamics(&system("drive"), &[brake], SignForm::Exact);
    for point in points(&model, 50, 8) {
        let [_, v, tau, _, m, most, at] = point[..].try_into().unwrap();
        let wanted = (tau - 2.0 * most * v * at / (at * at + v * v)) / m;
        let found = model.program.eval(&point)[1];
        assert_near(found, wanted, ROUNDING, "eddy_brake");
    }
}
