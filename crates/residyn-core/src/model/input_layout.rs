use std::ops::Range;

use crate::data::Joint;

/// Places of the inputs of a model's program with this many joints, internal states and further measured columns:
/// positions, velocities, internal states, torques (or commands), the measured columns and the time, then the parameters.
/// A model with internal states has their values at the step's start, and the step's length, before the parameters; a
/// torque balance has accelerations and directions of motion there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InputLayout {
    joints: usize,
    internal: usize,
    measured: usize,
}

impl InputLayout {
    /// That of a model without internal states and further measured columns.
    pub const fn of(joints: usize) -> Self {
        Self {
            joints,
            internal: 0,
            measured: 0,
        }
    }

    /// That of a model with this many of them.
    #[must_use]
    pub const fn with_measured(self, measured: usize) -> Self {
        Self { measured, ..self }
    }

    /// That of a model with this many internal states.
    #[must_use]
    pub const fn with_internal(self, internal: usize) -> Self {
        Self { internal, ..self }
    }

    pub const fn positions(self) -> Range<usize> {
        0..self.joints
    }

    pub const fn velocities(self) -> Range<usize> {
        self.joints..2 * self.joints
    }

    /// The internal states of effects.
    pub const fn internal(self) -> Range<usize> {
        2 * self.joints..2 * self.joints + self.internal
    }

    /// Positions, velocities, then internal states.
    pub const fn states(self) -> Range<usize> {
        0..self.internal().end
    }

    /// Torques or commands.
    pub const fn driving(self) -> Range<usize> {
        self.states().end..self.states().end + self.joints
    }

    /// Torques or commands, then the measured columns: all that a log gives and the motion does not change.
    pub const fn given(self) -> Range<usize> {
        self.states().end..self.time()
    }

    /// The torque or command of one joint.
    pub fn driving_of(self, joint: Joint) -> usize {
        self.driving().start + joint.index()
    }

    pub const fn time(self) -> usize {
        self.driving().end + self.measured
    }

    /// The internal states at the start of a step.
    pub const fn starts(self) -> Range<usize> {
        self.time() + 1..self.time() + 1 + self.internal
    }

    /// The length of a step, of a model with internal states.
    pub const fn step(self) -> usize {
        self.starts().end
    }

    /// The first parameter.
    pub const fn parameters(self) -> usize {
        match self.internal {
            0 => self.time() + 1,
            _ => self.step() + 1,
        }
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
