//! The torques that an arm's drivetrains take in addition to the motion of its bodies.

use nalgebra::Vector3;

use crate::bodies::Bodies;
use crate::hidden::Hidden;
use crate::laws::{At, DRY, Law, SMOOTH};

/// A motor that turns with its joint and `ratio` times the next one.
struct Coupled {
    joint: usize,
    ratio: f64,
    /// N m, N m s/rad, kg m^2
    dry: f64,
    viscous: f64,
    inertia: f64,
}

/// The drivetrains of an arm.
pub(super) struct Friction {
    /// Each with the joint that it acts on.
    smooth: Vec<(usize, Law)>,
    dry: Vec<(usize, Law)>,
    /// Share of each joint's torque that its gear loses.
    by_load: Vec<f64>,
    coupled: Vec<Coupled>,
}

impl Friction {
    /// The drivetrains with these effects; a load at the tip is added to the bodies.
    ///
    /// # Errors
    /// An effect that no arm of the bench has, or a missing number.
    pub fn of(effects: &[Hidden], joints: usize, bodies: &mut Bodies) -> Result<Self, String> {
        let mut all = Self {
            smooth: Vec::new(),
            dry: Vec::new(),
            by_load: vec![0.0; joints],
            coupled: Vec::new(),
        };
        for effect in effects {
            all.add(effect, bodies)?;
        }
        Ok(all)
    }

    fn add(&mut self, effect: &Hidden, bodies: &mut Bodies) -> Result<(), String> {
        let mut number = |name: &str| {
            let found = effect.values.get(name).copied();
            found.ok_or_else(|| format!("`{}` needs `{name}`", effect.name))
        };
        let joint = effect.joint.index();
        match effect.name.as_str() {
            name @ ("viscous_friction" | "degressive_friction") => {
                let law = Law::of(SMOOTH, name, &mut number)?;
                self.smooth.extend(law.map(|law| (joint, law)));
            }
            name @ ("coulomb_friction" | "stribeck_friction") => {
                let law = Law::of(DRY, name, &mut number)?;
                self.dry.extend(law.map(|law| (joint, law)));
            }
            "load_friction" => self.by_load[joint] = number("k")?,
            "joint_coupling" => self.coupled.push(Coupled {
                joint,
                ratio: number("r")?,
                dry: number("F_c")?,
                viscous: number("b")?,
                inertia: number("J")?,
            }),
            "payload" => {
                let at = Vector3::new(number("x")?, number("y")?, number("z")?);
                bodies.load(number("m")?, at);
            }
            name => return Err(format!("`{name}` is not an effect of the bench's arms")),
        }
        Ok(())
    }

    /// The torques to command for the torques that the bodies need.
    pub fn commanded(&self, needed: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
        let mut torques = needed.to_vec();
        let at = |joint: usize| At {
            v: qd[joint],
            direction: direction(qd[joint]),
            ..At::default()
        };
        for (joint, law) in &self.smooth {
            torques[*joint] -= law.at(at(*joint));
        }
        for (joint, law) in &self.dry {
            torques[*joint] += direction(qd[*joint]) * law.at(at(*joint));
        }
        for motor in &self.coupled {
            let sum = |of: &[f64]| of[motor.joint] + motor.ratio * of[motor.joint + 1];
            let speed = sum(qd);
            let own =
                motor.dry * direction(speed) + motor.viscous * speed + motor.inertia * sum(qdd);
            torques[motor.joint] += own;
            torques[motor.joint + 1] += motor.ratio * own;
        }
        for (j, torque) in torques.iter_mut().enumerate() {
            // The joint receives the command less the gear's share, against the motion.
            *torque /= 1.0 - self.by_load[j] * direction(qd[j]) * direction(*torque);
        }
        torques
    }
}

fn direction(velocity: f64) -> f64 {
    if velocity == 0.0 {
        0.0
    } else {
        velocity.signum()
    }
}
