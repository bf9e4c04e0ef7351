use std::ops::Range;

use crate::data::Joint;

/// Places of the inputs of a model's program with this many joints and further measured columns: positions, velocities,
/// torques (or commands), the measured columns and the time, then the parameters. A torque balance has accelerations and
/// directions of motion before the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputLayout {
    joints: usize,
    measured: usize,
}

impl InputLayout {
    /// That of a model without further measured columns.
    pub const fn of(joints: usize) -> Self {
        Self {
            joints,
            measured: 0,
        }
    }

    /// That of a model with this many of them.
    #[must_use]
    pub const fn with_measured(self, measured: usize) -> Self {
        Self { measured, ..self }
    }

    pub const fn positions(self) -> Range<usize> {
        0..self.joints
    }

    pub const fn velocities(self) -> Range<usize> {
        self.joints..2 * self.joints
    }

    /// Positions, then velocities.
    pub const fn states(self) -> Range<usize> {
        0..2 * self.joints
    }

    /// Torques or commands.
    pub const fn driving(self) -> Range<usize> {
        2 * self.joints..3 * self.joints
    }

    /// Torques or commands, then the measured columns: all that a log gives and the motion does not change.
    pub const fn given(self) -> Range<usize> {
        2 * self.joints..self.time()
    }

    /// The torque or command of one joint.
    pub fn driving_of(self, joint: Joint) -> usize {
        self.driving().start + joint.index()
    }

    pub const fn time(self) -> usize {
        3 * self.joints + self.measured
    }

    /// The first parameter, after the time.
    pub const fn parameters(self) -> usize {
        self.time() + 1
    }

    /// Accelerations of a torque balance.
    pub const fn accelerations(self) -> Range<usize> {
        self.time() + 1..self.time() + 1 + self.joints
    }

    /// Directions of motion of a torque balance, from -1 to 1.
    pub const fn directions(self) -> Range<usize> {
        self.accelerations().end..self.accelerations().end + self.joints
    }

    /// The first parameter of a torque balance.
    pub const fn parameters_of_balance(self) -> usize {
        self.directions().end
    }
}
