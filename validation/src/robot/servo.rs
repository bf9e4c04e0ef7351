//! Joints on position loops, and the motion of their bodies under targets.

use nalgebra::DVector;

use crate::bodies::Bodies;
use crate::drive::Drive;
use crate::hidden::Hidden;

/// Length of a step \[s\]: halving it changes less than an encoder resolves (tested below). A step in which a joint with dry
/// friction stops or turns back is taken in parts, down to the shortest.
const STEP_S: f64 = 2.5e-4;
const SHORTEST_S: f64 = 1e-5;
const PARTS: u32 = 5;

/// Friction of coupled joints is found one joint after the other, again and again, until no impulse changes by more than
/// this \[N m s\].
const SAME: f64 = 1e-12;
const SWEEPS: usize = 200;

/// A joint, its motor and its loop.
#[derive(Debug, Clone, Default)]
pub(super) struct Servo {
    /// Gains of the loop \[N m/rad\], \[N m s/rad\].
    pub stiffness: f64,
    pub damping: f64,
    pub drive: Drive,
    /// Amount by which its sensor, which closes the loop, reads high \[rad\].
    pub zero: f64,
    /// \[kg m^2\]
    pub rotor: f64,
    /// \[N m s/rad\], \[N m\]
    pub viscous: f64,
    pub dry: f64,
}

impl Servo {
    /// # Errors
    /// An effect that no robot of the bench has, or a missing number.
    pub fn add(&mut self, effect: &Hidden) -> Result<(), String> {
        let number = |name: &str| {
            let found = effect.values.get(name).copied();
            found.ok_or_else(|| format!("`{}` needs `{name}`", effect.name))
        };
        match effect.name.as_str() {
            "coulomb_friction" => self.dry = number("F_c")?,
            "viscous_friction" => self.viscous = number("b")?,
            "rotor_inertia" => self.rotor = number("J")?,
            "actuator_delay" => self.drive.delay = number("d")?,
            "actuator_gain" => self.drive.shape.gain = number("g")?,
            "actuator_saturation" => self.drive.shape.limit = number("m")?,
            "sensor_offset" => self.zero = number("q_z")?,
            name => return Err(format!("`{name}` is not an effect of the bench's robots")),
        }
        Ok(())
    }

    /// The torque that the loop asks for \[N m\].
    pub fn asked(&self, target: f64, q: f64, v: f64) -> f64 {
        self.stiffness * (target - q - self.zero) - self.damping * v
    }

    /// The torque on the joint but for dry friction \[N m\], and how much it falls with speed \[N m s/rad\].
    fn acting(&self, target: f64, q: f64, v: f64) -> [f64; 2] {
        let (asked, shape) = (self.asked(target, q, v), &self.drive.shape);
        let given = shape.at(asked, v);
        let is_limited = given.abs() >= shape.limit;
        let damping = match is_limited {
            true => 0.0,
            false => (1.0 + shape.gain) * self.damping,
        };
        [given - self.viscous * v, damping + self.viscous]
    }
}

/// A robot on a fixed base.
#[derive(Debug, Clone)]
pub(super) struct Rig {
    pub bodies: Bodies,
    pub servos: Vec<Servo>,
}

/// Where its joints are, how fast they move, and their accelerations in the step before.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub rate: DVector<f64>,
}

impl Motion {
    pub fn at_rest(q: &[f64]) -> Self {
        let zero = DVector::zeros(q.len());
        Self {
            q: DVector::from_column_slice(q),
            v: zero.clone(),
            rate: zero,
        }
    }
}

impl Rig {
    /// Moves on for `duration` s under these targets \[rad\].
    pub fn advance(&self, motion: &mut Motion, targets: &[f64], duration: f64) {
        self.advance_by(motion, targets, duration, STEP_S);
    }

    fn advance_by(&self, motion: &mut Motion, targets: &[f64], duration: f64, step_s: f64) {
        let steps = (duration / step_s).ceil();
        let mut left = steps;
        while left > 0.5 {
            self.step(motion, targets, duration / steps);
            left -= 1.0;
        }
    }

    /// A step of this length \[s\].
    pub fn step(&self, motion: &mut Motion, targets: &[f64], h: f64) {
        let next = self.after(motion, targets, h);
        let turns = |(j, servo): (usize, &Servo)| {
            servo.dry > 0.0 && motion.v[j] != 0.0 && motion.v[j] * next.v[j] <= 0.0
        };
        if h > SHORTEST_S && self.servos.iter().enumerate().any(turns) {
            for _ in 0..PARTS {
                self.step(motion, targets, h / f64::from(PARTS));
            }
        } else {
            *motion = next;
        }
    }

    /// A step by the midpoint rule: what depends on angles and speeds is taken at its middle.
    fn after(&self, motion: &Motion, targets: &[f64], h: f64) -> Motion {
        let middle = &motion.q + &motion.v * (0.5 * h);
        let ahead = &motion.v + &motion.rate * (0.5 * h);
        let posed = self.bodies.at(middle.as_slice());
        let zero = vec![0.0; self.servos.len()];
        let mut free = -DVector::from_vec(posed.torques(ahead.as_slice(), &zero));
        let mut mass = posed.mass();
        for (j, servo) in self.servos.iter().enumerate() {
            let [torque, damping] = servo.acting(targets[j], middle[j], ahead[j]);
            // The speed in the middle includes half of its change in this step.
            free[j] += torque + damping * (ahead[j] - motion.v[j]);
            mass[(j, j)] += servo.rotor + 0.5 * h * damping;
        }
        let inverse = mass.cholesky().expect("bodies have inertia").inverse();
        let mut after = &motion.v + &inverse * free * h;
        // Dry friction is whatever impulse brings a joint to rest, up to its level.
        let mut impulses = zero;
        for _ in 0..SWEEPS {
            let mut changed: f64 = 0.0;
            for (j, servo) in self.servos.iter().enumerate() {
                let most = h * servo.dry;
                let next = (impulses[j] - after[j] / inverse[(j, j)]).clamp(-most, most);
                let change = next - impulses[j];
                after += inverse.column(j) * change;
                impulses[j] = next;
                changed = changed.max(change.abs());
            }
            if changed < SAME {
                break;
            }
        }
        Motion {
            q: middle + &after * (0.5 * h),
            rate: (&after - &motion.v) / h,
            v: after,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use residyn_io::read_model;

    use super::{Motion, Rig, STEP_S, Servo};
    use crate::bodies::Bodies;
    use crate::drive::{Drive, Shape};
    use residyn_core::model::Library;

    fn leg(servo: &Servo) -> Rig {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/bench");
        let model = read_model(folder.join("robot-leg.toml"), &Library::built_in()).unwrap();
        Rig {
            bodies: Bodies::of(&model).unwrap(),
            servos: vec![servo.clone(); 3],
        }
    }

    fn geared() -> Servo {
        Servo {
            stiffness: 25.0,
            damping: 0.6,
            rotor: 0.01,
            viscous: 0.1,
            dry: 0.3,
            ..Servo::default()
        }
    }

    /// Angles every 10 ms of two seconds under targets that move and jump.
    fn path(rig: &Rig, step_s: f64) -> Vec<f64> {
        let mut motion = Motion::at_rest(&[0.1, 0.4, -0.8]);
        let mut all = Vec::new();
        for row in 0..200 {
            let time = 0.01 * f64::from(row);
            let jump = if row < 100 { 0.0 } else { 0.3 };
            let targets = [
                0.3 * (9.0 * time).sin(),
                0.5 * (13.0 * time).sin() + jump,
                -0.8 + 0.6 * (7.0 * time).cos(),
            ];
            rig.advance_by(&mut motion, &targets, 0.01, step_s);
            all.extend(motion.q.iter().copied());
        }
        all
    }

    #[test]
    fn halving_the_step_changes_less_than_an_encoder_resolves() {
        let limited = Servo {
            drive: Drive {
                shape: Shape {
                    limit: 4.0,
                    ..Shape::default()
                },
                ..Drive::default()
            },
            ..geared()
        };
        for servo in [geared(), limited] {
            let rig = leg(&servo);
            let [coarse, fine] = [STEP_S, 0.5 * STEP_S].map(|step_s| path(&rig, step_s));
            let off = coarse.iter().zip(&fine).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max);
            assert!(off < 9e-5, "{off} rad");
        }
    }

    #[test]
    fn a_joint_rests_where_its_friction_exceeds_what_else_acts() {
        let rig = leg(&Servo {
            dry: 50.0,
            ..geared()
        });
        let mut motion = Motion::at_rest(&[0.1, 0.4, -0.8]);
        rig.advance(&mut motion, &[0.5, -0.5, 0.5], 0.5);
        let moved = (&motion.q - Motion::at_rest(&[0.1, 0.4, -0.8]).q).amax();
        assert!(moved < 1e-9, "{moved}");
    }

    #[test]
    fn a_sensor_that_reads_high_moves_the_joint_the_other_way() {
        let off = Servo {
            zero: 0.05,
            ..geared()
        };
        let still = |servo: &Servo| {
            let mut rig = leg(servo);
            rig.servos.iter_mut().for_each(|servo| servo.dry = 0.0);
            let mut motion = Motion::at_rest(&[0.0; 3]);
            rig.advance(&mut motion, &[0.0; 3], 8.0);
            motion.q
        };
        let moved = still(&off) - still(&geared());
        assert!(
            moved.iter().all(|moved| (-0.06..-0.03).contains(moved)),
            "{moved}"
        );
    }
}
