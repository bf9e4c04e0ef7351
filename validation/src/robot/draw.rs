//! The hidden effects of a robot, drawn at random in sizes that geared joints have.

use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};

use super::servo::{Motion, Rig};
use super::{Hides, Robot, at};
use crate::hidden::Hidden;
use residyn_core::data::Joint;

/// Torques of friction and of a rotor at typical speeds and accelerations, as shares of the root-mean-square torque that the
/// loop of a joint asks for, or of a twentieth of the strongest joint's if that is more.
const SHARES: [f64; 2] = [0.08, 0.3];
const LEAST: f64 = 0.05;
/// Inertia of a rotor as a share of what its joint moves, if that is more: less could as well be an error of the bodies.
const ROTOR: [f64; 2] = [0.3, 0.8];
/// Joints that are built alike differ by up to this share.
const SPREAD: f64 = 0.03;
/// How many times the friction of its like a worn joint has.
const WORN: [f64; 2] = [1.8, 2.5];
/// \[s\]
const DELAY: [f64; 2] = [0.004, 0.015];
/// Share by which a drive's torque is off, up or down: more than bodies are off by.
const GAIN: [f64; 2] = [0.25, 0.5];
/// Gravity tells the gain of a drive if it takes at least this share of its torque.
const WEIGHT: f64 = 0.5;
/// A limit, as a share of the largest torque that the loop asks for.
const LIMIT: [f64; 2] = [0.5, 0.75];
/// \[rad\]
const ZERO: [f64; 2] = [0.03, 0.08];

/// Length and step of the motion that tells what is typical of a joint \[s\].
const SECONDS: f64 = 10.0;
const STEP_S: f64 = 2e-3;

/// What is typical of a joint.
#[derive(Debug, Clone, Default)]
struct Typical {
    /// Root mean squares of the torque that the loop asks for \[N m\], of gravity's \[N m\], of the speed \[rad/s\] and of
    /// the acceleration \[rad/s^2\].
    torque: f64,
    weight: f64,
    speed: f64,
    acceleration: f64,
    /// What it moves with the joints at zero \[kg m^2\].
    inertia: f64,
    /// The largest torque \[N m\].
    peak: f64,
    /// Whether another body carries it.
    is_carried: bool,
}

impl Robot {
    pub(super) fn draw(&self, rig: &Rig, rng: &mut impl Rng) -> Vec<Hidden> {
        if self.hides == Hides::Nothing {
            return Vec::new();
        }
        let typical = self.typical(rig, rng);
        let joints: Vec<Joint> = Joint::all(typical.len()).collect();
        let sets = self.sets(&joints);
        let mut effects = Vec::new();
        // At least one set of joints has them.
        let first = rng.random_range(0..sets.len());
        for (k, set) in sets.iter().enumerate() {
            if k == first || rng.random_bool(0.75) {
                effects.extend(of_drivetrain(set, &typical, rng));
            }
        }
        if rng.random_bool(0.5) {
            let delay = rng.random_range(DELAY[0]..DELAY[1]);
            let late = |joint: &Joint| Hidden::new("actuator_delay", *joint, &[("d", delay)]);
            effects.extend(joints.iter().map(late));
        }
        match self.hides {
            Hides::Nothing | Hides::Drives | Hides::Together => {}
            Hides::Worn => wear(&mut effects, &self.build.like, &typical, rng),
            Hides::Gains => effects.extend(gains(&joints, &typical, rng)),
            Hides::Limits => {
                let set = sets.choose(rng).cloned().unwrap_or_default();
                let peak = mean(&set, |joint| typical[joint].peak);
                let limit = peak * rng.random_range(LIMIT[0]..LIMIT[1]);
                let limit = |joint| Hidden::new("actuator_saturation", joint, &[("m", limit)]);
                effects.extend(set.into_iter().map(limit));
            }
            Hides::Zeros => {
                effects.extend(some(&joints, rng).into_iter().map(|joint| {
                    Hidden::new("sensor_offset", joint, &[("q_z", signed(ZERO, rng))])
                }))
            }
        }
        effects
    }

    /// Sets of joints that are built alike, single ones among them.
    fn sets(&self, joints: &[Joint]) -> Vec<Vec<Joint>> {
        let like = &self.build.like;
        let single = |joint: &&Joint| !like.iter().flatten().any(|other| other == *joint);
        let single = joints.iter().filter(single).map(|joint| vec![*joint]);
        like.iter().cloned().chain(single).collect()
    }

    /// What is typical of each joint of a robot without effects.
    fn typical(&self, rig: &Rig, rng: &mut impl Rng) -> Vec<Typical> {
        let targets = self.targets(1.0, rng);
        let mut motion = Motion::at_rest(&at(&targets, 0.0));
        let joints = rig.servos.len();
        let zero = vec![0.0; joints];
        let mass = rig.bodies.at(&zero).mass();
        let mut all = vec![Typical::default(); joints];
        let mut time = 0.0;
        while time < SECONDS {
            let wanted = at(&targets, time);
            let weight = rig.bodies.torques(motion.q.as_slice(), &zero, &zero);
            for (j, of) in all.iter_mut().enumerate() {
                let torque = rig.servos[j].asked(wanted[j], motion.q[j], motion.v[j]);
                let share = STEP_S / SECONDS;
                of.torque += share * torque.powi(2);
                of.weight += share * weight[j].powi(2);
                of.speed += share * motion.v[j].powi(2);
                of.acceleration += share * motion.rate[j].powi(2);
                of.peak = of.peak.max(torque.abs());
            }
            rig.step(&mut motion, &wanted, STEP_S);
            time += STEP_S;
        }
        let strongest = all.iter().map(|of| of.torque.sqrt()).fold(0.0, f64::max);
        for (j, of) in all.iter_mut().enumerate() {
            of.torque = of.torque.sqrt().max(LEAST * strongest);
            for square in [&mut of.weight, &mut of.speed, &mut of.acceleration] {
                *square = square.sqrt();
            }
            of.inertia = mass[(j, j)];
            of.is_carried = rig.bodies.is_carried(j);
        }
        all
    }
}

/// The mean of a number over some joints.
fn mean(joints: &[Joint], of: impl Fn(Joint) -> f64) -> f64 {
    joints.iter().map(|joint| of(*joint)).sum::<f64>() / joints.len() as f64
}

fn signed([least, most]: [f64; 2], rng: &mut impl Rng) -> f64 {
    let size = rng.random_range(least..most);
    if rng.random() { size } else { -size }
}

/// About a third of these joints, at least one.
fn some(joints: &[Joint], rng: &mut impl Rng) -> Vec<Joint> {
    let first = rng.random_range(0..joints.len());
    let is_drawn = |k: usize, rng: &mut dyn Rng| k == first || rng.random_bool(0.33);
    let drawn = joints.iter().enumerate();
    let drawn = drawn.filter(|(k, _)| is_drawn(*k, rng));
    drawn.map(|(_, joint)| *joint).collect()
}

/// An effect of like joints, with about the same number.
fn alike(
    name: &str,
    parameter: &str,
    value: f64,
    set: &[Joint],
    rng: &mut impl Rng,
) -> Vec<Hidden> {
    let mut own = |joint: &Joint| {
        let value = value * (1.0 + rng.random_range(-SPREAD..SPREAD));
        Hidden::new(name, *joint, &[(parameter, value)])
    };
    set.iter().map(&mut own).collect()
}

fn dry(set: &[Joint], typical: &[Typical], rng: &mut impl Rng) -> Vec<Hidden> {
    let level = mean(set, |joint| typical[joint].torque);
    let level = level * rng.random_range(SHARES[0]..SHARES[1]);
    alike("coulomb_friction", "F_c", level, set, rng)
}

/// Two or all of dry friction, viscous friction and a rotor. The rotor of a joint on the base is part of its body's inertia:
/// no motion tells the two apart.
fn of_drivetrain(set: &[Joint], typical: &[Typical], rng: &mut impl Rng) -> Vec<Hidden> {
    let without = rng.random_range(0..6);
    let mut effects = Vec::new();
    if without != 0 {
        effects.extend(dry(set, typical, rng));
    }
    if without != 1 {
        let slope = mean(set, |joint| typical[joint].torque / typical[joint].speed);
        let slope = slope * rng.random_range(SHARES[0]..SHARES[1]);
        effects.extend(alike("viscous_friction", "b", slope, set, rng));
    }
    let carried: Vec<Joint> = (set.iter().copied())
        .filter(|joint| typical[*joint].is_carried)
        .collect();
    if without != 2 && !carried.is_empty() {
        let by_torque = rng.random_range(SHARES[0]..SHARES[1]);
        let by_inertia = rng.random_range(ROTOR[0]..ROTOR[1]);
        let inertia = mean(set, |joint| {
            let of = &typical[joint];
            (by_torque * of.torque / of.acceleration).max(by_inertia * of.inertia)
        });
        effects.extend(alike("rotor_inertia", "J", inertia, &carried, rng));
    }
    effects
}

/// One of like joints has more dry friction than the others, which have some.
fn wear(effects: &mut Vec<Hidden>, like: &[Vec<Joint>], typical: &[Typical], rng: &mut impl Rng) {
    let Some(set) = like.choose(rng) else {
        return;
    };
    let is_dry = |effect: &&mut Hidden, joint: Joint| {
        effect.joint == joint && effect.name == "coulomb_friction"
    };
    if !effects.iter_mut().any(|effect| is_dry(&effect, set[0])) {
        effects.extend(dry(set, typical, rng));
    }
    let worn = set[rng.random_range(0..set.len())];
    let factor = rng.random_range(WORN[0]..WORN[1]);
    let own = effects.iter_mut().filter(|effect| is_dry(effect, worn));
    own.flat_map(|effect| effect.values.values_mut())
        .for_each(|level| *level *= factor);
}

/// Gains of some of the drives that carry weight, of the one that carries most if none carries much.
fn gains(joints: &[Joint], typical: &[Typical], rng: &mut impl Rng) -> Vec<Hidden> {
    let share = |joint: &Joint| typical[*joint].weight / typical[*joint].torque;
    let mut carry: Vec<Joint> = joints.to_vec();
    carry.retain(|joint| share(joint) >= WEIGHT);
    let most = joints.iter().max_by(|a, b| share(a).total_cmp(&share(b)));
    carry.extend(most.filter(|_| carry.is_empty()));
    let drawn = some(&carry, rng).into_iter();
    let off = |joint| Hidden::new("actuator_gain", joint, &[("g", signed(GAIN, rng))]);
    drawn.map(off).collect()
}
