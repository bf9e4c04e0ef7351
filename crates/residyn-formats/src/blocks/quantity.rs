//! The numbers of a joint's actuator, each with the interval in which a fit found it.

use crate::robot::powertrain::Powertrain;

/// What a simulator knows of a position-controlled joint, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Stiffness,
    Damping,
    Effort,
    Armature,
    DryFriction,
    ViscousFriction,
    Delay,
}

/// A value, and the interval in which a fit found it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number {
    pub value: f64,
    pub range: Option<[f64; 2]>,
}

/// Smallest change relative to a value that is one: the slopes of a drive are differences of torques.
const ROUNDING: f64 = 1e-9;

impl Quantity {
    pub const ALL: [Self; 7] = [
        Self::Stiffness,
        Self::Damping,
        Self::Effort,
        Self::Armature,
        Self::DryFriction,
        Self::ViscousFriction,
        Self::Delay,
    ];

    pub fn words(self) -> &'static str {
        match self {
            Self::Stiffness => "the stiffness",
            Self::Damping => "the damping",
            Self::Effort => "the limit of the torque",
            Self::Armature => "the armature",
            Self::DryFriction => "dry friction",
            Self::ViscousFriction => "viscous friction",
            Self::Delay => "the delay",
        }
    }

    /// Its value on a joint; only a limit can be missing.
    fn value(self, powertrain: &Powertrain) -> Option<f64> {
        let Powertrain { joint, drive, .. } = powertrain;
        match self {
            Self::Stiffness => Some(drive.gain),
            Self::Damping => Some(-drive.bias[2]),
            Self::Effort => drive.effort(),
            Self::Armature => Some(joint.armature),
            Self::DryFriction => Some(joint.friction),
            Self::ViscousFriction => Some(joint.damping),
            Self::Delay => Some(drive.delay.unwrap_or(0.0)),
        }
    }

    /// Its value on a joint, and its interval from the joint's powertrain with one parameter after the other at the ends of
    /// its own. Parameters err independently: their squares add up.
    pub fn number(self, powertrain: &Powertrain, at_ends: &[[&Powertrain; 2]]) -> Option<Number> {
        let value = self.value(powertrain)?;
        let mut squares = [0.0, 0.0];
        for ends in at_ends {
            let moves = ends.map(|end| self.value(end).map_or(0.0, |end| end - value));
            for (square, sign) in squares.iter_mut().zip([-1.0, 1.0]) {
                *square += moves
                    .map(|by| sign * by)
                    .into_iter()
                    .fold(0.0, f64::max)
                    .powi(2);
            }
        }
        let [down, up] = squares.map(f64::sqrt);
        let is_fitted = down.max(up) > ROUNDING * value.abs();
        // None of these numbers can be negative.
        let range = is_fitted.then(|| [(value - down).max(0.0), value + up]);
        Some(Number { value, range })
    }
}
