use nalgebra::{Matrix3, Vector3};

use super::model_file::LIMIT;
use super::recursive::Place;
use super::{Inertia, Pose, turn};
use crate::data;
use crate::model::ReadyDrive;

/// A spring between a joint and its base: force `-stiffness * (q - rest)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// N m/rad, or N/m.
    pub stiffness: f64,
    /// Coordinate without force, rad or m.
    pub rest: f64,
}

/// What acts on a joint besides inertia and gravity.
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
    /// A loop that holds the joint at the commanded position.
    pub servo: Option<Servo>,
}

/// A position loop: torque = stiffness * (command - q) - damping * qd.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Servo {
    /// N m/rad, or N/m.
    pub stiffness: f64,
    /// N m s/rad, or N s/m.
    pub damping: f64,
    /// Whether its user knows the two, so that fits hold them.
    pub is_known: bool,
}

/// How a joint follows another: its coordinate is `ratio * q + offset`, with the leader's q.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follows {
    /// Index of the leader among the joints of the tree.
    pub leader: usize,
    pub ratio: f64,
    /// rad or m
    pub offset: f64,
}

/// One joint of a tree, with everything that moves with it up to the next joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    pub name: String,
    /// Name of the body that the joint moves.
    pub body: String,
    /// Index of the joint that carries it, which comes before it; `None` for one on the base.
    pub parent: Option<usize>,
    /// Whether it slides along its axis rather than turning about it.
    pub slides: bool,
    /// The joint's frame in that of its parent (or the world) at coordinate `reference`; z is the joint's axis.
    pub pose: Pose,
    /// rad or m
    pub reference: f64,
    /// The frame's x axis in the frame of the file's body, which first moments refer to.
    pub across: Vector3<f64>,
    /// The axis in the frame of the file's body.
    pub axis: Vector3<f64>,
    /// The frame's origin in the frame of the file's body, m.
    pub anchor: Vector3<f64>,
    /// In the joint's frame.
    pub inertia: Inertia,
    /// The joint of the tree that it follows, if any.
    pub follows: Option<Follows>,
    pub drivetrain: Drivetrain,
}

impl Joint {
    /// The joint's frame in that of the file's body.
    pub fn in_body(&self) -> Pose {
        Pose {
            rotation: Matrix3::from_columns(&[
                self.across,
                self.axis.cross(&self.across),
                self.axis,
            ]),
            origin: self.anchor,
        }
    }

    /// The joint's frame in that of its parent (or the world) at coordinate zero.
    pub fn at_zero(&self) -> Pose {
        self.at(0.0)
    }

    /// As above, at this coordinate (rad or m).
    pub fn at(&self, coordinate: f64) -> Pose {
        let moved = coordinate - self.reference;
        let moved = if self.slides {
            Pose {
                rotation: Matrix3::identity(),
                origin: Vector3::z() * moved,
            }
        } else {
            Pose {
                rotation: turn(Vector3::z(), moved),
                origin: Vector3::zeros(),
            }
        };
        self.pose.then(&moved)
    }
}

/// A mechanism on a fixed base: from 1 to [`JOINTS`](crate::limits::JOINTS) joints, each on the base or carried by one
/// that comes before it.
#[derive(Debug, Clone)]
pub struct Tree {
    pub name: String,
    /// Acceleration, m/s^2, in the world frame.
    pub gravity: Vector3<f64>,
    pub joints: Vec<Joint>,
    /// What drives every joint, if known and not a torque.
    pub drive: Option<ReadyDrive>,
    /// Properties of the file that the model file does not carry, or carries in another form.
    pub notes: Vec<String>,
}

impl Tree {
    /// The joints that follow no other, with their numbers.
    pub fn leaders(&self) -> impl Iterator<Item = (data::Joint, &Joint)> {
        let leaders = self.joints.iter().filter(|joint| joint.follows.is_none());
        leaders
            .enumerate()
            .map(|(k, joint)| (data::Joint::at(k), joint))
    }

    /// The tree with this drive at every joint. A note names the joints whose limit nobody has given.
    #[must_use]
    pub fn driven_by(mut self, drive: ReadyDrive) -> Self {
        let is_open = |joint: &&Joint| joint.drivetrain.effort.is_none() && joint.follows.is_none();
        let open = self.joints.iter().filter(is_open);
        let open: Vec<&str> = open.map(|joint| joint.name.as_str()).collect();
        if drive.has(LIMIT) && !open.is_empty() {
            self.notes.push(format!(
                "the file gives no effort limit of {}: `{LIMIT}` of the drive is an example; write the rig's in its place",
                open.join(", ")
            ));
        }
        self.drive = Some(drive);
        self
    }

    /// The tree with a position loop of known gains at every joint that follows no other, in the order of these joints: as
    /// many of both as there are such joints, or one for all (N m/rad and N m s/rad, or N/m and N s/m).
    #[must_use]
    pub fn with_gains(mut self, stiffness: &[f64], damping: &[f64]) -> Self {
        let leaders = self.joints.iter_mut();
        let leaders = leaders.filter(|joint| joint.follows.is_none());
        let gains = stiffness.iter().cycle().zip(damping.iter().cycle());
        for (joint, (stiffness, damping)) in leaders.zip(gains) {
            joint.drivetrain.servo = Some(Servo {
                stiffness: *stiffness,
                damping: *damping,
                is_known: true,
            });
        }
        self
    }

    /// The tree without damping, dry friction and rotors. A note has the values that are left out.
    #[must_use]
    pub fn with_bare_joints(mut self) -> Self {
        for joint in &mut self.joints {
            let own = &mut joint.drivetrain;
            let parts = [
                ("damping", &mut own.damping),
                ("dry friction", &mut own.friction),
                ("rotor inertia", &mut own.armature),
            ];
            let parts = parts.into_iter().filter(|(_, value)| **value != 0.0);
            let left = parts.map(|(name, value)| format!("{name} {}", std::mem::take(value)));
            let left: Vec<String> = left.collect();
            if !left.is_empty() {
                let note = format!("left out of joint {}: {}", joint.name, left.join(", "));
                self.notes.push(note);
            }
        }
        self
    }
}

/// Where each link sits, and what moves it. Joints that follow no other are numbered in their order.
pub(super) fn places(joints: &[Joint]) -> Vec<Place> {
    let leads = |joint: &&Joint| joint.follows.is_none();
    let number = |at: usize| data::Joint::at(joints[..at].iter().filter(leads).count());
    let place = |(at, joint): (usize, &Joint)| {
        let follows = joint.follows.unwrap_or(Follows {
            leader: at,
            ratio: 1.0,
            offset: 0.0,
        });
        Place {
            parent: joint.parent,
            pose: joint.at_zero(),
            slides: joint.slides,
            joint: number(follows.leader),
            ratio: follows.ratio,
            offset: follows.offset,
        }
    };
    joints.iter().enumerate().map(place).collect()
}
