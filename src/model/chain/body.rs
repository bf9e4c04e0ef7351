use nalgebra::Vector3;

use super::{Inertia, Pose};

/// A spring between a joint and its base: force `-stiffness * (q - rest)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// N m/rad, or N/m.
    pub stiffness: f64,
    /// Coordinate without force, rad or m.
    pub rest: f64,
}

/// What acts on a joint beside inertia and gravity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drivetrain {
    /// N m s/rad, or N s/m.
    pub damping: f64,
    /// Dry friction, N m or N.
    pub friction: f64,
    /// Inertia of the rotor seen by the joint, kg m^2 or kg.
    pub armature: f64,
    pub spring: Option<Spring>,
    /// Effort limit of the drive, N m or N.
    pub effort: Option<f64>,
}

/// One joint of a serial chain, with everything that moves with it up to the next joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    pub name: String,
    /// Name of the body that the joint moves.
    pub body: String,
    /// Whether it slides along its axis rather than turning about it.
    pub slides: bool,
    /// The joint's frame in that of the previous joint (or the world) where the joint's coordinate is `reference`; z is
    /// the joint's axis.
    pub pose: Pose,
    /// rad or m
    pub reference: f64,
    /// The frame's x axis in the frame of the file's body, which first moments refer to.
    pub across: Vector3<f64>,
    /// The axis in the frame of the file's body.
    pub axis: Vector3<f64>,
    /// In the joint's frame.
    pub inertia: Inertia,
    pub drivetrain: Drivetrain,
}

/// A serial mechanism: from 1 to [`MOST_JOINTS`](super::MOST_JOINTS) joints, each carrying the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    pub name: String,
    /// Acceleration, m/s^2, in the frame of the world.
    pub gravity: Vector3<f64>,
    pub joints: Vec<Joint>,
    /// Properties of the file that the model file does not carry, or carries in another form.
    pub notes: Vec<String>,
}
