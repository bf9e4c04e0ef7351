//! What moves the joints of a model, as simulators represent it: drives that are linear up to a limit, and what a joint
//! adds to its load.

use super::servo::{Servo, servos, tangents};
use super::value;
use crate::export_model::reads;
use crate::{ExportModel, ExportedEffect};
use residyn_core::model::Parameter;
use residyn_core::model::tree::{Drivetrain, Spring};

/// The powertrains of a model, one a joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Powertrains {
    pub joints: Vec<Powertrain>,
    /// Parts of the model beyond its declared equations that they do not hold.
    pub not_carried: Vec<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Powertrain {
    /// Damping, dry friction, rotor and spring.
    pub joint: Drivetrain,
    /// The coordinate (rad or m) at which the bodies are where the declared ones are at zero.
    pub zero: f64,
    pub drive: Drive,
    /// The motor, if it stands behind a transmission.
    pub motor: Option<Motor>,
}

/// A motor with an inertia of its own, on which the drive acts, behind a spring or a play.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motor {
    /// kg m^2
    pub inertia: f64,
    pub passes: Passes,
    /// Whether the model's angle is that of the motor, not of the link; and whether friction acts on it.
    pub has_sensor: bool,
    pub has_friction: bool,
    /// Place of the twist among the model's states.
    pub state: usize,
    /// What it is, for messages.
    pub said: String,
}

/// What passes from a motor to its link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Passes {
    /// Of a spring, N m/rad, and a damper, N m s/rad.
    Spring { stiffness: f64, damping: f64 },
    /// Nothing but at the ends of a play, rad.
    Play(f64),
}

/// A drive: torque = clamp(gain * command + bias), the command late and lagged.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Drive {
    pub gain: f64,
    /// A constant (N m or N), and slopes by position and velocity of the joint.
    pub bias: [f64; 3],
    /// Lowest and highest torque, N m or N.
    pub range: Option<[f64; 2]>,
    /// In s.
    pub delay: Option<f64>,
    /// Time constant in s.
    pub lag: Option<f64>,
}

/// A position loop: torque = stiffness * (command - q) - damping * qd.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionLoop {
    pub stiffness: f64,
    pub damping: f64,
}

/// Largest difference between a drive's gain and its slope by position, relative to the gain, in a position loop: slopes are
/// differences of torques.
const ROUNDING: f64 = 1e-9;

impl Powertrains {
    /// The powertrains of a model.
    ///
    /// # Errors
    /// A network in place of the equations, equations that depend on time, or drives of another form.
    pub fn of(model: &ExportModel) -> Result<Self, String> {
        if model.prior.is_some() {
            return Err("a network replaces its equations".into());
        }
        if model.depends_on_time() {
            return Err("its equations depend on time".into());
        }
        let parameters = &model.equations.parameters;
        let mut powertrains = Self::behind(drives(model, parameters)?, model, parameters);
        let lost = &mut powertrains.not_carried;
        if model.residual.is_some() {
            lost.push("the network that learns what the equations lack".into());
        }
        lost.extend(model.sensors_not_carried());
        Ok(powertrains)
    }

    /// The powertrains with one parameter that may move them after the other at the two ends of its interval, all others at their
    /// values. Of a model that has powertrains.
    pub fn at_ends(model: &ExportModel) -> Vec<[Vec<Powertrain>; 2]> {
        let parameters = &model.equations.parameters;
        let declared = model.system.parameters.len();
        let program = model.system.drive_program();
        let moves = |k: usize| {
            let input = 3 * model.joints() + 1 + k;
            k >= declared
                || program
                    .as_ref()
                    .is_some_and(|program| reads(program, input))
        };
        let at_end = |k: usize, end: f64| {
            let mut moved = parameters.clone();
            moved[k].value = end;
            Self::behind(drives_near(model, &moved), model, &moved).joints
        };
        let at_ends = |(k, parameter): (usize, &Parameter)| {
            let ends = parameter.ci95.filter(|_| moves(k))?;
            let is_closed = ends.iter().all(|end| end.is_finite());
            is_closed.then(|| ends.map(|end| at_end(k, end)))
        };
        parameters.iter().enumerate().filter_map(at_ends).collect()
    }

    /// Drives with the effects of a model, at these values.
    fn behind(drives: Vec<Drive>, model: &ExportModel, parameters: &[Parameter]) -> Self {
        let joints = drives.into_iter().map(|drive| Powertrain {
            joint: Drivetrain::default(),
            zero: 0.0,
            drive,
            motor: None,
        });
        let mut powertrains = Self {
            joints: joints.collect(),
            not_carried: Vec::new(),
        };
        // A constant torque acts behind limits and gains, wherever the file states it; other friction in each direction is one.
        let constants = ["constant_torque", "asymmetric_friction"];
        let is_constant = |effect: &&ExportedEffect| constants.contains(&effect.name.as_str());
        let (constant, others): (Vec<_>, Vec<_>) = model.effects.iter().partition(is_constant);
        for effect in others.into_iter().chain(constant) {
            powertrains.carry(effect, model, parameters);
        }
        powertrains
    }

    fn carry(&mut self, effect: &ExportedEffect, model: &ExportModel, parameters: &[Parameter]) {
        let value = |name: &String| value(parameters, name).unwrap_or(0.0);
        let values: Vec<f64> = effect.parameters.iter().map(value).collect();
        let Powertrain {
            joint,
            zero,
            drive,
            motor,
        } = &mut self.joints[effect.joint.index()];
        let lost = &mut self.not_carried;
        let on = format!(
            "{} on joint {}",
            effect.name,
            model.system.joint_label(effect.joint)
        );
        match (effect.name.as_str(), &values[..]) {
            ("viscous_friction", [b]) => joint.damping += b,
            ("coulomb_friction", [level]) => joint.friction += level,
            ("stribeck_friction", [level, ..]) => {
                joint.friction += level;
                lost.push(format!(
                    "{on}: its excess near standstill; dry friction of {level:.4} is written"
                ));
            }
            ("asymmetric_friction", [forward, backward, slope_forward, slope_backward]) => {
                joint.friction += 0.5 * (forward + backward);
                drive.add(0.5 * (backward - forward));
                joint.damping += 0.5 * (slope_forward + slope_backward);
                if slope_forward != slope_backward {
                    lost.push(format!(
                        "{on}: slopes that differ by direction; their mean is written"
                    ));
                }
            }
            ("rotor_inertia", [inertia]) => joint.armature += inertia,
            ("joint_spring", [stiffness, rest]) => {
                joint.spring = Some(Spring {
                    stiffness: *stiffness,
                    rest: *rest,
                });
            }
            ("gravity_tilt", [angle]) => *zero -= angle,
            ("sensor_offset", [offset]) => *zero += offset,
            ("actuator_gain", [excess]) => drive.scale(1.0 + excess),
            ("actuator_saturation", [limit]) => drive.limit(*limit),
            ("actuator_delay", [time]) => drive.delay = Some(*time).filter(|time| *time > 0.0),
            ("actuator_lag", [time]) => drive.lag = Some(*time),
            ("constant_torque", [torque]) => drive.add(*torque),
            ("joint_elasticity", [stiffness, damping, inertia, sides @ ..]) => {
                let passes = Passes::Spring {
                    stiffness: *stiffness,
                    damping: *damping,
                };
                *motor = Some(Motor::of(model, effect, passes, (*inertia, sides)));
            }
            ("motor_backlash", [play, _, _, inertia, sides @ ..]) => {
                let passes = Passes::Play(*play);
                *motor = Some(Motor::of(model, effect, passes, (*inertia, sides)));
                lost.push(format!(
                    "{on}: the stiffness and damping of its contacts; the ends of the play are those of a joint"
                ));
            }
            _ => lost.push(format!("{on}: {}", effect.expression)),
        }
    }
}

impl Motor {
    /// The motor of an effect, with an inertia and the sides of sensor and friction.
    fn of(
        model: &ExportModel,
        effect: &ExportedEffect,
        passes: Passes,
        (inertia, sides): (f64, &[f64]),
    ) -> Self {
        let mut internal = model.internal();
        let before = internal.position(|(own, _)| own == effect);
        Self {
            inertia,
            passes,
            has_sensor: sides.first().is_some_and(|side| *side > 0.5),
            has_friction: sides.last().is_some_and(|side| *side > 0.5),
            state: 2 * model.joints() + before.expect("a transmission has states"),
            said: format!("{}: {}", effect.name, effect.expression),
        }
    }
}

impl Drive {
    /// What the commanded torque does.
    const DIRECT: Self = Self {
        gain: 1.0,
        bias: [0.0; 3],
        range: None,
        delay: None,
        lag: None,
    };

    fn of(servo: Servo) -> Self {
        Self {
            gain: servo.gain,
            bias: servo.bias,
            range: servo.limit.map(|limit| [-limit, limit]),
            ..Self::DIRECT
        }
    }

    fn scale(&mut self, factor: f64) {
        self.gain *= factor;
        self.bias = self.bias.map(|slope| slope * factor);
        self.range = self.range.map(|range| range.map(|end| end * factor));
    }

    fn limit(&mut self, limit: f64) {
        let [low, high] = self.range.unwrap_or([-limit, limit]);
        self.range = Some([low.max(-limit), high.min(limit)]);
    }

    fn add(&mut self, torque: f64) {
        self.bias[0] += torque;
        self.range = self.range.map(|range| range.map(|end| end + torque));
    }

    /// The largest torque of either sign without the constant, N m or N.
    pub fn effort(&self) -> Option<f64> {
        self.range.map(|[low, high]| 0.5 * (high - low))
    }

    /// The position loop, constant aside, if the drive is one.
    pub fn position_loop(&self) -> Option<PositionLoop> {
        let [_, by_position, by_velocity] = self.bias;
        let holds = (self.gain + by_position).abs() <= ROUNDING * self.gain;
        (holds && self.gain > 0.0).then_some(PositionLoop {
            stiffness: self.gain,
            damping: -by_velocity,
        })
    }
}

/// The drives of a model's joints, without effects.
fn drives(model: &ExportModel, parameters: &[Parameter]) -> Result<Vec<Drive>, String> {
    let Some(program) = model.system.drive_program() else {
        return Ok(vec![Drive::DIRECT; model.joints()]);
    };
    let servos = servos(&program, model.joints(), &declared(model, parameters))?;
    Ok(servos.into_iter().map(Drive::of).collect())
}

/// The same at other values, known to have that form.
fn drives_near(model: &ExportModel, parameters: &[Parameter]) -> Vec<Drive> {
    let Some(program) = model.system.drive_program() else {
        return vec![Drive::DIRECT; model.joints()];
    };
    let servos = tangents(&program, model.joints(), &declared(model, parameters));
    servos.into_iter().map(Drive::of).collect()
}

/// Values of the parameters that the file declares, those of effects aside.
fn declared(model: &ExportModel, parameters: &[Parameter]) -> Vec<f64> {
    let declared = parameters.iter().take(model.system.parameters.len());
    declared.map(|parameter| parameter.value).collect()
}
