//! The hidden effects of an arm, drawn at random in sizes that geared arms have.

use rand::{Rng, RngExt};

use super::motion::Motion;
use super::{Arm, Lacks};
use crate::bodies::Bodies;
use crate::hidden::Hidden;
use residyn_core::data::Joint;

/// Friction as a share of the root-mean-square torque that the bodies' motion takes at a joint, or of a twentieth of
/// the strongest joint's if that is more: wrists have more friction than load.
const SHARES: [f64; 2] = [0.08, 0.3];
const LEAST: f64 = 0.05;

/// Seconds over which these torques are taken.
const SECONDS: u32 = 20;

impl Arm {
    pub(super) fn draw(&self, bodies: &Bodies, motion: &Motion, rng: &mut impl Rng) -> Vec<Hidden> {
        if self.lacks == Lacks::Nothing {
            return Vec::new();
        }
        let (sizes, speeds) = typical(bodies, motion);
        let joints: Vec<Joint> = Joint::all(sizes.len()).collect();
        if self.lacks == Lacks::CoulombViscous {
            let mut both =
                |joint: &Joint| coulomb_viscous(*joint, sizes[*joint], speeds[*joint], rng);
            return joints.iter().flat_map(&mut both).collect();
        }
        let mut effects: Vec<Hidden> = joints
            .iter()
            .map(|joint| friction(*joint, sizes[*joint], speeds[*joint], rng))
            .collect();
        let last = joints.len() - 1;
        match self.lacks {
            Lacks::Nothing | Lacks::CoulombViscous | Lacks::Friction => {}
            Lacks::LoadFriction => {
                // A joint where the bodies load the gear.
                let joint = joints[rng.random_range(1..3)];
                effects.push(Hidden::new(
                    "load_friction",
                    joint,
                    &[("k", rng.random_range(0.06..0.2))],
                ));
            }
            Lacks::Coupling => {
                let joint = joints[last - rng.random_range(1..=2)];
                let size = sizes[joint].max(sizes[joint.next()]);
                let speed = speeds[joint].max(speeds[joint.next()]);
                let ratio = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                let mut share = || rng.random_range(0.1..0.3) * size;
                let values = [
                    ("F_c", share()),
                    ("b", share() / speed),
                    ("J", 0.1 * share() / speed.powi(2)),
                    ("r", ratio),
                ];
                effects.push(Hidden::new("joint_coupling", joint, &values));
            }
            Lacks::Payload => {
                let (mass, reach) = bodies.tip();
                let values = [
                    ("m", mass * rng.random_range(1.5..4.0)),
                    ("x", reach * rng.random_range(-1.0..1.0)),
                    ("y", reach * rng.random_range(-1.0..1.0)),
                    ("z", reach + rng.random_range(0.05..0.15)),
                ];
                effects.push(Hidden::new("payload", joints[last], &values));
            }
        }
        effects
    }
}

fn coulomb_viscous(joint: Joint, size: f64, speed: f64, rng: &mut impl Rng) -> [Hidden; 2] {
    let mut level = || size * rng.random_range(SHARES[0]..SHARES[1]);
    [
        Hidden::new("coulomb_friction", joint, &[("F_c", level())]),
        Hidden::new("viscous_friction", joint, &[("b", level() / speed)]),
    ]
}

/// One of four kinds of friction.
fn friction(joint: Joint, size: f64, speed: f64, rng: &mut impl Rng) -> Hidden {
    let level = size * rng.random_range(SHARES[0]..SHARES[1]);
    let slow = speed * rng.random_range(0.05..0.2);
    match rng.random_range(0..4) {
        0 => Hidden::new("viscous_friction", joint, &[("b", level / speed)]),
        1 => Hidden::new("coulomb_friction", joint, &[("F_c", level)]),
        2 => {
            let more = level * rng.random_range(1.5..2.5);
            let values = [("F_c", level), ("F_s", more), ("v_s", slow)];
            Hidden::new("stribeck_friction", joint, &values)
        }
        _ => {
            // The drawn level is the friction at the typical speed.
            let rise = level / (speed / slow).asinh();
            Hidden::new(
                "degressive_friction",
                joint,
                &[("F_d", rise), ("v_d", slow)],
            )
        }
    }
}

/// For each joint, the torque (N m) that scales its friction, and the root mean square of its speed (rad/s).
fn typical(bodies: &Bodies, motion: &Motion) -> (Vec<f64>, Vec<f64>) {
    let times = (0..20 * SECONDS).map(|k| f64::from(k) / 20.0);
    let at = |time| {
        let [q, qd, qdd] = motion.at(time);
        (bodies.torques(&q, &qd, &qdd), qd)
    };
    let (torques, speeds): (Vec<Vec<f64>>, Vec<Vec<f64>>) = times.map(at).unzip();
    let rms = |rows: &[Vec<f64>]| -> Vec<f64> {
        let mean =
            |j: usize| rows.iter().map(|row| row[j].powi(2)).sum::<f64>() / rows.len() as f64;
        (0..rows[0].len()).map(|j| mean(j).sqrt()).collect()
    };
    let torques = rms(&torques);
    let strongest = torques.iter().copied().fold(0.0, f64::max);
    let sizes = torques.iter().map(|torque| torque.max(LEAST * strongest));
    (sizes.collect(), rms(&speeds))
}
