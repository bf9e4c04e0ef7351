//! Hidden effects by name, as written in a grid, and what they change in a rig.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::laws::{DRY, Law, SMOOTH};
use super::machine::Machine;
use super::mechanics::Mechanics;
use super::presliding::{Presliding, Stribeck};
use super::transmission::Transmission;
use super::warming::Warming;
use residyn_core::data::Joint;

/// `coulomb_friction@1`; for a shift, `parameter_shift(m1)`.
pub type Label = String;

pub fn label(name: &str, joint: Joint, parameter: &str) -> Label {
    match name {
        "parameter_shift" => format!("{name}({parameter})"),
        _ => format!("{name}@{joint}"),
    }
}

/// An effect that a rig has and its model does not declare.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    pub name: String,
    pub joint: Joint,
    /// Its numbers, in N m, rad and s; for a shift, the parameter's true value; for a sensor offset, the spread `q_z`
    /// over the logs.
    #[serde(flatten)]
    pub values: BTreeMap<String, f64>,
}

impl Hidden {
    pub(crate) fn new(name: &str, joint: Joint, values: &[(&str, f64)]) -> Self {
        let values = values.iter();
        Self {
            name: name.to_owned(),
            joint,
            values: values
                .map(|(name, value)| ((*name).to_owned(), *value))
                .collect(),
        }
    }

    pub fn label(&self) -> Label {
        let parameters: Vec<&str> = self.values.keys().map(String::as_str).collect();
        label(&self.name, self.joint, &parameters.join(", "))
    }
}

impl Machine {
    /// A rig with these effects.
    ///
    /// # Errors
    /// An unknown effect, a joint that the rig does not have, or missing or surplus numbers.
    pub(crate) fn with(mechanics: Mechanics, effects: &[Hidden]) -> Result<Self, String> {
        let mut machine = Self::bare(mechanics);
        for effect in effects {
            machine.add(effect)?;
        }
        Ok(machine)
    }

    fn add(&mut self, hidden: &Hidden) -> Result<(), String> {
        let joints = self.joints();
        if !hidden.joint.is_of(joints) {
            let name = &hidden.name;
            return Err(format!("`{name}`: `joint` must be from 1 to {joints}"));
        }
        if hidden.name == "parameter_shift" {
            return self.shift(hidden);
        }
        let j = hidden.joint.index();
        let mut left = hidden.values.clone();
        let mut take = |name: &str| {
            let missing = || format!("`{}` needs `{name}`", hidden.name);
            left.remove(name).ok_or_else(missing)
        };
        let smooth = Law::of(SMOOTH, &hidden.name, &mut take)?;
        let dry = Law::of(DRY, &hidden.name, &mut take)?;
        if smooth.is_none() && dry.is_none() {
            self.change(hidden, take)?;
        }
        self.smooth.extend(smooth.map(|law| (j, law)));
        self.dry.extend(dry.map(|law| (j, law)));
        match left.keys().next() {
            Some(name) => Err(format!("`{}` has no `{name}`", hidden.name)),
            None => Ok(()),
        }
    }

    /// Add an effect that is neither a smooth torque nor dry friction; `n` takes its numbers by name.
    fn change(
        &mut self,
        hidden: &Hidden,
        mut n: impl FnMut(&str) -> Result<f64, String>,
    ) -> Result<(), String> {
        let j = hidden.joint.index();
        let drive = &mut self.drives[j];
        match hidden.name.as_str() {
            name @ ("presliding" | "lugre_friction") => {
                let (level, stiffness) = (n("F_c")?, n("sigma_0")?);
                let mut friction = Presliding {
                    level,
                    stiffness,
                    ..Presliding::default()
                };
                if name == "lugre_friction" {
                    friction.damping = n("sigma_1")?;
                    let (excess, speed) = (n("F_s")? - level, n("v_s")?);
                    friction.stribeck = Some(Stribeck { excess, speed });
                }
                self.presliding.push((j, friction));
            }
            "cable_hysteresis" => {
                let (level, way) = (n("F")?, n("alpha")?);
                let loop_of_cable = Presliding {
                    level,
                    stiffness: level / way,
                    ..Presliding::default()
                };
                self.presliding.push((j, loop_of_cable));
                let mut spring = |name: &str| if name == "k" { n("k") } else { Ok(0.0) };
                let spring = Law::of(SMOOTH, "joint_spring", &mut spring)?;
                self.smooth.extend(spring.map(|law| (j, law)));
            }
            "thermal_friction" => {
                let (share, time) = (n("a")?, n("T")?);
                self.warming[j] = Some(Warming { share, time });
            }
            "gravity_tilt" if j == 0 => self.tilt += n("delta")?,
            "rotor_inertia" => self.rotor[j] += n("J")?,
            "actuator_gain" => drive.shape.gain = n("g")?,
            "actuator_deadzone" => drive.shape.deadzone = n("w")?,
            "actuator_saturation" => drive.shape.limit = n("m")?,
            "back_emf_limit" => (drive.shape.limit, drive.shape.back_emf) = (n("m")?, n("k")?),
            "torque_speed_limit" => {
                (drive.shape.limit, drive.shape.no_load_speed) = (n("tau_max")?, n("v_0")?);
            }
            "actuator_delay" => drive.delay = n("d")?,
            "actuator_lag" => drive.lag = n("T")?,
            "backlash" => self.transmissions[j] = Some(Transmission::backlash(n("delta")?)),
            "joint_compliance" => self.transmissions[j] = Some(Transmission::giving(n("c")?)),
            name @ ("joint_elasticity" | "motor_backlash") => {
                if n("friction")? > 0.0 {
                    return Err(format!(
                        "`{name}`: friction acts on the link, so `friction` must be 0"
                    ));
                }
                let (inertia, has_encoder) = (n("J_m")?, n("sensor")? > 0.5);
                self.transmissions[j] = Some(match name {
                    "motor_backlash" => Transmission::with_play(n("delta")?, inertia, has_encoder),
                    _ => Transmission {
                        play: 0.0,
                        stiffness: n("k")?,
                        damping: n("d")?,
                        inertia,
                        has_encoder,
                        is_lumped: false,
                    },
                });
            }
            "encoder_eccentricity" => self.eccentricity[j] = [n("e_s")?, n("e_c")?],
            // A property of the sensor, not of the machine: each log draws its own.
            "sensor_offset" => drop(n("q_z")?),
            name => return Err(format!("`{name}` cannot act on joint {}", hidden.joint)),
        }
        Ok(())
    }

    fn shift(&mut self, hidden: &Hidden) -> Result<(), String> {
        for (name, value) in &hidden.values {
            let unknown = || format!("`parameter_shift`: the rig has no `{name}`");
            self.mechanics.set(name, *value).ok_or_else(unknown)?;
        }
        Ok(())
    }
}

#[cfg(test)]
impl Machine {
    /// With an effect on one of its joints, counted from 0.
    pub(crate) fn hiding(mut self, joint: usize, name: &str, values: &[(&str, f64)]) -> Self {
        let effect = Hidden::new(name, Joint::at(joint), values);
        self.add(&effect).unwrap();
        self
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::Hidden;
    use crate::drive::Approach;
    use crate::machine::{Machine, State};
    use crate::mechanics::tests::double_pendulum;
    use residyn_core::data::Joint;

    fn hidden(name: &str, values: &[(&str, f64)]) -> Hidden {
        Hidden::new(name, Joint::at(0), values)
    }

    /// Change of the first joint's acceleration due to this effect, at one state and torque.
    fn adds(effect: &Hidden) -> f64 {
        adds_all(std::slice::from_ref(effect))
    }

    /// The same of several effects.
    fn adds_all(effects: &[Hidden]) -> f64 {
        let state = State {
            q: [0.4, 0.3],
            v: [1.5, -0.5],
            motor_q: [0.41, 0.3],
            motor_v: [1.5, -0.5],
            bristle: [0.01, 0.0],
        };
        let command = Approach {
            target: 2.0,
            since: -1.0,
            ..Approach::default()
        };
        let acceleration = |effects: &[Hidden]| {
            let machine = Machine::with(double_pendulum(), effects).unwrap();
            let commands = [command; 2];
            let directions = machine.directions(0.2, &state, &commands);
            machine.slope(0.2, &state, &commands, directions).v[0]
        };
        acceleration(effects) - acceleration(&[])
    }

    #[test]
    fn every_effect_changes_the_acceleration_in_its_direction() {
        let against = [
            hidden("viscous_friction", &[("b", 0.1)]),
            hidden("coulomb_friction", &[("F_c", 0.1)]),
            hidden(
                "stribeck_friction",
                &[("F_c", 0.1), ("F_s", 0.2), ("v_s", 1.0)],
            ),
            hidden(
                "asymmetric_friction",
                &[("F_p", 0.1), ("F_n", 0.2), ("b_p", 0.0), ("b_n", 0.0)],
            ),
            hidden("degressive_friction", &[("F_d", 0.1), ("v_d", 0.2)]),
            hidden("quadratic_drag", &[("c", 0.1)]),
            hidden("load_friction", &[("k", 0.1)]),
            hidden("gear_friction", &[("k_driving", 0.1), ("k_driven", 0.3)]),
            hidden("joint_spring", &[("k", 0.1), ("q_0", 0.0)]),
            hidden("gravity_tilt", &[("delta", 0.1)]),
            hidden("actuator_deadzone", &[("w", 0.1)]),
            hidden("actuator_saturation", &[("m", 1.5)]),
            hidden("cubic_damping", &[("c", 0.1)]),
            hidden("uneven_friction", &[("F", 0.1), ("a", 0.5)]),
            hidden("presliding", &[("F_c", 0.2), ("sigma_0", 10.0)]),
            hidden(
                "lugre_friction",
                &[
                    ("F_c", 0.2),
                    ("F_s", 0.3),
                    ("v_s", 0.1),
                    ("sigma_0", 10.0),
                    ("sigma_1", 0.1),
                ],
            ),
            hidden(
                "cable_hysteresis",
                &[("k", 0.1), ("F", 0.2), ("alpha", 0.02)],
            ),
            hidden("back_emf_limit", &[("m", 2.0), ("k", 0.1)]),
            hidden("torque_speed_limit", &[("tau_max", 2.0), ("v_0", 12.0)]),
        ];
        for effect in &against {
            assert!(adds(effect) < -1e-3, "{effect:?}: {}", adds(effect));
        }
        let along = [
            hidden("joint_spring", &[("k", 0.1), ("q_0", 1.0)]),
            hidden("constant_torque", &[("tau_0", 0.1)]),
            hidden("cogging_torque", &[("A", 0.1), ("N", 3.0), ("phase", 0.0)]),
            hidden(
                "fractional_ripple",
                &[("A", 0.1), ("N", 2.5), ("phase", 0.0)],
            ),
            hidden(
                "gear_ripple",
                &[("A", 0.1), ("c", 0.1), ("N", 3.0), ("phase", 0.0)],
            ),
            hidden("actuator_gain", &[("g", 0.1)]),
            hidden(
                "periodic_disturbance",
                &[("A", 0.1), ("f", 1.0), ("phase", 0.0)],
            ),
        ];
        for effect in &along {
            assert!(adds(effect) > 1e-3, "{effect:?}: {}", adds(effect));
        }
    }

    #[test]
    fn a_warm_machine_has_less_friction_and_is_otherwise_the_same() {
        let warming = hidden("thermal_friction", &[("a", 0.5), ("T", 1e-3)]);
        let friction = hidden("coulomb_friction", &[("F_c", 0.2)]);
        let viscous = hidden("viscous_friction", &[("b", 0.1)]);
        let bristles = hidden("presliding", &[("F_c", 0.2), ("sigma_0", 10.0)]);
        let spring = hidden("joint_spring", &[("k", 0.1), ("q_0", 0.0)]);
        let accelerations = |effects: &[&Hidden]| {
            let effects: Vec<Hidden> = effects.iter().map(|effect| (*effect).clone()).collect();
            adds_all(&effects)
        };
        for one in [&friction, &viscous, &bristles] {
            let (cold, warm) = (accelerations(&[one]), accelerations(&[one, &warming]));
            assert!((warm - 0.5 * cold).abs() < 1e-9, "{one:?}: {warm} {cold}");
        }
        let (alone, warm) = (
            accelerations(&[&spring]),
            accelerations(&[&spring, &warming]),
        );
        assert_eq!(alone, warm);
    }

    #[test]
    fn rotor_inertia_acts_on_its_own_joint_alone() {
        let heavy = Machine::bare(double_pendulum()).hiding(0, "rotor_inertia", &[("J", 0.1)]);
        let bare = Machine::bare(double_pendulum());
        let state = State::at_rest([0.4, 0.3]);
        let commands = [Approach::default(); 2];
        let slopes = [&bare, &heavy].map(|m| m.slope(0.0, &state, &commands, [0.0; 2]).v);
        let mass = bare.mechanics.mass(state.q);
        // M a = (M + diag(J, 0)) a' in both rows.
        let torque = |a: [f64; 2], row: usize| mass[row][0] * a[0] + mass[row][1] * a[1];
        let first = torque(slopes[1], 0) + 0.1 * slopes[1][0];
        assert!((torque(slopes[0], 0) - first).abs() < 1e-12);
        assert!((torque(slopes[0], 1) - torque(slopes[1], 1)).abs() < 1e-12);
    }

    #[test]
    fn a_shift_of_an_unknown_parameter_is_refused() {
        let shifted = |name| {
            let effect = hidden("parameter_shift", &[(name, 1.0)]);
            Machine::with(double_pendulum(), &[effect])
        };
        assert_ne!(shifted("m2").unwrap().mechanics, double_pendulum());
        let wrong = shifted("m3");
        assert_eq!(wrong.unwrap_err(), "`parameter_shift`: the rig has no `m3`");
    }

    #[test]
    fn the_encoder_is_on_the_motor_or_on_the_link() {
        let soft = |sensor: f64| {
            let own = [("k", 30.0), ("d", 0.2), ("J_m", 0.01)];
            [own.as_slice(), &[("sensor", sensor), ("friction", 0.0)]].concat()
        };
        let loose = |sensor: f64| {
            let own = [("delta", 0.01), ("J_m", 0.01)];
            [own.as_slice(), &[("sensor", sensor), ("friction", 0.0)]].concat()
        };
        for (name, values, read) in [
            ("backlash", [("delta", 0.01)].as_slice(), 0.5),
            ("joint_elasticity", &soft(1.0), 0.5),
            ("joint_elasticity", &soft(0.0), 0.4),
            ("motor_backlash", &loose(1.0), 0.5),
            ("motor_backlash", &loose(0.0), 0.4),
        ] {
            let machine = Machine::bare(double_pendulum()).hiding(0, name, values);
            let mut state = State::at_rest([0.4, 0.3]);
            state.motor_q = [0.5, 0.6];
            assert_eq!(machine.encoders(&state), [read, 0.3]);
        }
    }

    #[test]
    fn a_disc_off_its_axis_reads_ahead_and_behind() {
        let disc = [("e_s", 0.02), ("e_c", -0.01)];
        let machine = Machine::bare(double_pendulum()).hiding(0, "encoder_eccentricity", &disc);
        let read = |q: f64| machine.encoders(&State::at_rest([q, 0.3]));
        assert_eq!(read(0.0), [-0.01, 0.3]);
        assert!((read(FRAC_PI_2)[0] - FRAC_PI_2 - 0.02).abs() < 1e-15);
        assert!((read(PI)[0] - PI - 0.01).abs() < 1e-15);
    }
}
