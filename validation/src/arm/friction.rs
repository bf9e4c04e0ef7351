//! The torques that an arm's drivetrains take in addition to the motion of its bodies.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::Bodies;
use crate::hidden::Hidden;

/// Friction law of one joint: torque by velocity.
type Law = Box<dyn Fn(f64) -> f64 + Sync>;

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
    laws: Vec<Vec<Law>>,
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
            laws: (0..joints).map(|_| Vec::new()).collect(),
            by_load: vec![0.0; joints],
            coupled: Vec::new(),
        };
        for effect in effects {
            all.add(effect, bodies)?;
        }
        Ok(all)
    }

    fn add(&mut self, effect: &Hidden, bodies: &mut Bodies) -> Result<(), String> {
        let number = |name: &str| number(&effect.values, name);
        let joint = effect.joint.index();
        let law: Law = match effect.name.as_str() {
            "viscous_friction" => {
                let b = number("b")?;
                Box::new(move |v| b * v)
            }
            "coulomb_friction" => {
                let level = number("F_c")?;
                Box::new(move |v| level * direction(v))
            }
            "stribeck_friction" => {
                let [slow, fast, bend] = [number("F_s")?, number("F_c")?, number("v_s")?];
                Box::new(move |v| {
                    direction(v) * (fast + (slow - fast) * (-(v / bend).powi(2)).exp())
                })
            }
            "degressive_friction" => {
                let [rise, bend] = [number("F_d")?, number("v_d")?];
                Box::new(move |v| rise * (v / bend).asinh())
            }
            "load_friction" => {
                self.by_load[joint] = number("k")?;
                return Ok(());
            }
            "joint_coupling" => {
                self.coupled.push(Coupled {
                    joint,
                    ratio: number("r")?,
                    dry: number("F_c")?,
                    viscous: number("b")?,
                    inertia: number("J")?,
                });
                return Ok(());
            }
            "payload" => {
                let at = Vector3::new(number("x")?, number("y")?, number("z")?);
                bodies.load(number("m")?, at);
                return Ok(());
            }
            name => return Err(format!("`{name}` is not an effect of the bench's arms")),
        };
        self.laws[joint].push(law);
        Ok(())
    }

    /// The torques to command for the torques that the bodies need.
    pub fn commanded(&self, needed: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
        let mut torques = needed.to_vec();
        for (j, torque) in torques.iter_mut().enumerate() {
            *torque += self.laws[j].iter().map(|law| law(qd[j])).sum::<f64>();
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

fn number(values: &BTreeMap<String, f64>, name: &str) -> Result<f64, String> {
    let found = values.get(name).copied();
    found.ok_or_else(|| format!("an effect of an arm needs `{name}`"))
}
