//! A tree of bodies, each welded to its parent or attached by joints, and the chain that it amounts to.

use nalgebra::Vector3;

use crate::formats::xml::Source;
use crate::model::FileError;
use crate::model::chain::{
    Drivetrain, Inertia, Joint, MOST_JOINTS, Pose, fault, with_z_along, without_inertia,
};

/// A joint in the frame of the body that it moves.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::formats) struct Hinge {
    pub name: String,
    /// Position in the file, bytes.
    pub at: usize,
    pub slides: bool,
    /// A unit vector.
    pub axis: Vector3<f64>,
    /// A point of the axis, m.
    pub anchor: Vector3<f64>,
    pub reference: f64,
    pub drivetrain: Drivetrain,
}

/// A body with its descendants.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::formats) struct Body {
    pub name: String,
    pub at: usize,
    /// In the frame of the parent, joints at their references.
    pub pose: Pose,
    /// From the parent outwards; none where it is welded to the parent.
    pub joints: Vec<Hinge>,
    /// In the body's own frame.
    pub inertia: Inertia,
    pub children: Vec<Body>,
}

impl Body {
    fn moves(&self) -> bool {
        !self.joints.is_empty() || self.children.iter().any(Self::moves)
    }

    /// Whether this is the body of that name, or an ancestor of it.
    pub fn holds(&self, name: &str) -> bool {
        self.name == name || self.children.iter().any(|child| child.holds(name))
    }
}

/// The joints of a tree without branches, welded bodies lumped together.
///
/// # Errors
/// Branches, no joint or too many, joints that move no inertia.
pub(in crate::formats) fn chain(source: &Source<'_>, base: &Body) -> Result<Vec<Joint>, FileError> {
    let mut joints = Vec::new();
    let mut places = Vec::new();
    grow(source, &mut joints, &mut places, base, &Pose::identity())?;
    if joints.is_empty() {
        let message = "there is no joint that moves; give a mechanism of revolute, continuous or prismatic joints (hinge or slide in MJCF)";
        return Err(source.error_at(base.at, message));
    }
    if let Some(light) = without_inertia(&joints) {
        let message = format!(
            "joint `{}` moves nothing that has inertia; give <inertial> of `{}` or of its descendants",
            joints[light].name, joints[light].body
        );
        return Err(source.error_at(places[light], message));
    }
    Ok(joints)
}

/// A name with characters of file names and columns alone.
pub(in crate::formats) fn plain(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || c == '-' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).collect()
}

/// Add a body and its descendants; `parent` is its parent's frame in that of the last joint.
fn grow(
    source: &Source<'_>,
    joints: &mut Vec<Joint>,
    places: &mut Vec<usize>,
    body: &Body,
    parent: &Pose,
) -> Result<(), FileError> {
    let mut frame = parent.then(&body.pose);
    for hinge in &body.joints {
        if joints.len() == MOST_JOINTS {
            let message = format!(
                "joint `{}` is one too many: at most {MOST_JOINTS} are derived in closed form; fix the joints that the rig does not use",
                hinge.name
            );
            return Err(source.error_at(hinge.at, message));
        }
        let own = Pose {
            rotation: with_z_along(hinge.axis),
            origin: hinge.anchor,
        };
        places.push(hinge.at);
        joints.push(joint(body, hinge, frame.then(&own)));
        frame = own.inverse();
    }
    if let Some(last) = joints.last_mut() {
        last.inertia = last.inertia.with(&body.inertia.seen_from(&frame));
    }
    let (moving, fixed): (Vec<&Body>, Vec<&Body>) =
        body.children.iter().partition(|child| child.moves());
    if let Some(branch) = moving.get(1) {
        let message = format!(
            "`{}` branches: both `{}` and `{}` move; keep one branch and fix the other's joints",
            body.name, moving[0].name, branch.name
        );
        return Err(source.error_at(branch.at, message));
    }
    // Welded children belong to this joint: they come before the next joint.
    for child in fixed.into_iter().chain(moving) {
        grow(source, joints, places, child, &frame)?;
    }
    Ok(())
}

fn joint(body: &Body, hinge: &Hinge, pose: Pose) -> Joint {
    Joint {
        name: hinge.name.clone(),
        body: body.name.clone(),
        slides: hinge.slides,
        pose,
        reference: hinge.reference,
        across: with_z_along(hinge.axis).column(0).into(),
        axis: hinge.axis,
        inertia: Inertia::none(),
        drivetrain: hinge.drivetrain,
    }
}

/// Refuse a mass (kg) or an inertia tensor (kg m^2, about the centre of mass) that no body can have; `at` is its position
/// in the file.
pub(in crate::formats) fn check_inertia(
    source: &Source<'_>,
    at: usize,
    body: &str,
    mass: f64,
    tensor: &nalgebra::Matrix3<f64>,
) -> Result<(), FileError> {
    if mass < 0.0 {
        let message = format!("the mass of `{body}` is {mass}; give one above zero");
        return Err(source.error_at(at, message));
    }
    fault(tensor).map_or(Ok(()), |fault| {
        let message = format!(
            "the inertia of `{body}` about its centre of mass {fault}, which no body has; correct it"
        );
        Err(source.error_at(at, message))
    })
}
