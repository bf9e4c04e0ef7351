//! Effects by name, as a grid writes them, and what they change in a rig.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::force::Force;
use super::friction::{DryFriction, Presliding};
use super::judge::{Label, label};
use super::machine::Machine;
use super::mechanics::Mechanics;
use super::transmission::Transmission;

/// One effect that a rig has and its model does not declare.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    pub name: String,
    /// Counted from 1.
    pub joint: usize,
    /// Its numbers, in N m, rad and s; of a shift, the parameter's true value; of a sensor's offset, the
    /// spread `q_z` over the logs.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl Hidden {
    pub fn label(&self) -> Label {
        let parameters: Vec<&str> = self.values.keys().map(String::as_str).collect();
        label(&self.name, self.joint, &parameters.join(", "))
    }
}

/// Takes the numbers of an effect one by one.
struct Numbers<'h> {
    of: &'h Hidden,
    left: BTreeMap<String, f64>,
}

impl Numbers<'_> {
    fn take(&mut self, name: &str) -> Result<f64, String> {
        let missing = || format!("`{}` needs `{name}`", self.of.name);
        self.left.remove(name).ok_or_else(missing)
    }

    fn none_left(&self) -> Result<(), String> {
        match self.left.keys().next() {
            Some(name) => Err(format!("`{}` has no `{name}`", self.of.name)),
            None => Ok(()),
        }
    }
}

impl Machine {
    /// A rig with these effects.
    ///
    /// # Errors
    /// An effect that is not known, on a joint that there is not, or with numbers that are not its own.
    pub fn with(mechanics: Mechanics, effects: &[Hidden]) -> Result<Self, String> {
        let mut machine = Self::bare(mechanics);
        for effect in effects {
            machine.add(effect)?;
        }
        Ok(machine)
    }

    fn add(&mut self, hidden: &Hidden) -> Result<(), String> {
        let joints = self.joints();
        if !(1..=joints).contains(&hidden.joint) {
            let name = &hidden.name;
            return Err(format!("`{name}`: `joint` is from 1 to {joints}"));
        }
        if hidden.name == "parameter_shift" {
            return self.shift(hidden);
        }
        let j = hidden.joint - 1;
        let mut numbers = Numbers {
            of: hidden,
            left: hidden.values.clone(),
        };
        let mut n = |name: &str| numbers.take(name);
        let drive = &mut self.drives[j];
        match hidden.name.as_str() {
            "viscous_friction" => self.forces.push((j, Force::Viscous { b: n("b")? })),
            "quadratic_drag" => self.forces.push((j, Force::QuadraticDrag { c: n("c")? })),
            "cubic_damping" => self.forces.push((j, Force::CubicDamping { c: n("c")? })),
            "joint_spring" => {
                let (k, q_0) = (n("k")?, n("q_0")?);
                self.forces.push((j, Force::Spring { k, q_0 }));
            }
            "constant_torque" => {
                let tau_0 = n("tau_0")?;
                self.forces.push((j, Force::Constant { tau_0 }));
            }
            "cogging_torque" | "fractional_ripple" => {
                let (amplitude, periods, phase) = (n("A")?, n("N")?, n("phase")?);
                self.forces.push((
                    j,
                    Force::Ripple {
                        amplitude,
                        periods,
                        phase,
                    },
                ));
            }
            "periodic_disturbance" => {
                let (amplitude, frequency_hz, phase) = (n("A")?, n("f")?, n("phase")?);
                self.forces.push((
                    j,
                    Force::Hum {
                        amplitude,
                        frequency_hz,
                        phase,
                    },
                ));
            }
            "coulomb_friction" => {
                let level = n("F_c")?;
                self.dry.push((j, DryFriction::Coulomb { level }));
            }
            "stribeck_friction" => {
                let (f_c, f_s, v_s) = (n("F_c")?, n("F_s")?, n("v_s")?);
                self.dry.push((j, DryFriction::Stribeck { f_c, f_s, v_s }));
            }
            "asymmetric_friction" => {
                let (forward, backward) = (n("F_p")?, n("F_n")?);
                self.dry
                    .push((j, DryFriction::Asymmetric { forward, backward }));
                let (b_p, b_n) = (n("b_p")?, n("b_n")?);
                self.forces.push((j, Force::TwoSlopes { b_p, b_n }));
            }
            "load_friction" => self.dry.push((j, DryFriction::Load { share: n("k")? })),
            "uneven_friction" => {
                let (level, share) = (n("F")?, n("a")?);
                self.dry.push((j, DryFriction::Uneven { level, share }));
            }
            "presliding" => {
                let (level, stiffness) = (n("F_c")?, n("sigma")?);
                self.presliding.push((j, Presliding { level, stiffness }));
            }
            "gravity_tilt" if j == 0 => self.tilt += n("delta")?,
            "rotor_inertia" => self.rotor[j] += n("J")?,
            "actuator_gain" => drive.shape.gain = n("g")?,
            "actuator_deadzone" => drive.shape.deadzone = n("w")?,
            "actuator_saturation" => drive.shape.limit = n("m")?,
            "back_emf_limit" => (drive.shape.limit, drive.shape.back_emf) = (n("m")?, n("k")?),
            "actuator_delay" => drive.delay = n("d")?,
            "actuator_lag" => drive.lag = n("T")?,
            "backlash" => self.transmissions[j] = Some(Transmission::backlash(n("delta")?)),
            "joint_compliance" => {
                let (stiffness, inertia) = (n("k")?, n("J")?);
                self.transmissions[j] = Some(Transmission::compliance(stiffness, inertia));
            }
            // Of the sensor, not of the machine: see `offsets`.
            "sensor_offset" => drop(n("q_z")?),
            name => return Err(format!("`{name}` is no effect of joint {}", hidden.joint)),
        }
        numbers.none_left()
    }

    fn shift(&mut self, hidden: &Hidden) -> Result<(), String> {
        for (name, value) in &hidden.values {
            let unknown = || format!("`parameter_shift`: the rig has no `{name}`");
            self.mechanics.set(name, *value).ok_or_else(unknown)?;
        }
        Ok(())
    }
}
