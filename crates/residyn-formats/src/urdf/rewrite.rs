//! Writes values into an existing file and leaves the rest of it unchanged.

use nalgebra::Matrix3;
use roxmltree::Node;

use super::read::Robot;
use crate::robot::edit::{Edit, same};
use crate::robot::mechanism::numbers;
use crate::robot::write_back::{Change, body, is_some};
use crate::xml::{Source, named};
use residyn_core::model::FileError;
use residyn_core::model::tree::{Drivetrain, Inertia};

/// Add the edits that make these changes to the file.
///
/// # Errors
/// A joint that is not there, or values that no body can have.
pub fn rewrite(
    source: &Source<'_>,
    edit: &mut Edit<'_>,
    changes: &[Change],
) -> Result<(), FileError> {
    let robot = Robot::new(source)?;
    for change in changes {
        let joint = robot.joint(&change.joint)?;
        write_dynamics(source, edit, joint, &change.drivetrain)?;
        if is_some(&change.added) {
            write_inertia(&robot, edit, robot.end(joint, "child")?, &change.added)?;
        }
    }
    Ok(())
}

fn write_dynamics(
    source: &Source<'_>,
    edit: &mut Edit<'_>,
    joint: Node<'_, '_>,
    wanted: &Drivetrain,
) -> Result<(), FileError> {
    let dynamics = named(joint, "dynamics").next();
    let mut missing = String::new();
    for (key, value) in [("damping", wanted.damping), ("friction", wanted.friction)] {
        let given = match dynamics {
            Some(dynamics) => source.element(dynamics).not_negative(key)?,
            None => 0.0,
        };
        match dynamics {
            _ if same(given, value) => {}
            Some(dynamics) => edit.set(dynamics, key, &[value]),
            None => missing += &format!(" {key}=\"{}\"", numbers([value])),
        }
    }
    if !missing.is_empty() {
        edit.insert(joint, &format!("<dynamics{missing}/>"));
    }
    Ok(())
}

fn write_inertia<'s>(
    robot: &Robot<'s, '_>,
    edit: &mut Edit<'_>,
    link: Node<'s, '_>,
    added: &Inertia,
) -> Result<(), FileError> {
    let whole = robot.inertia(link)?.with(added);
    let (centre, tensor) = body(robot.source, link, &whole)?;
    let Some(inertial) = named(link, "inertial").next() else {
        let inertial = format!(
            "<inertial><origin xyz=\"{}\"/><mass value=\"{}\"/>{}</inertial>",
            numbers(&centre),
            numbers([whole.mass]),
            inertia(&tensor)
        );
        edit.insert(link, &inertial);
        return Ok(());
    };
    let part = |name| named(inertial, name).next();
    let turn = robot.pose(inertial)?.rotation;
    match part("origin") {
        Some(origin) => edit.set(origin, "xyz", centre.as_slice()),
        None => edit.insert(inertial, &format!("<origin xyz=\"{}\"/>", numbers(&centre))),
    }
    if let Some(mass) = part("mass") {
        edit.set(mass, "value", &[whole.mass]);
    }
    if let Some(inertia) = part("inertia") {
        for (key, value) in entries(&(turn.transpose() * tensor * turn)) {
            edit.set(inertia, key, &[value]);
        }
    }
    Ok(())
}

fn entries(tensor: &Matrix3<f64>) -> [(&'static str, f64); 6] {
    [
        ("ixx", 0, 0),
        ("ixy", 0, 1),
        ("ixz", 0, 2),
        ("iyy", 1, 1),
        ("iyz", 1, 2),
        ("izz", 2, 2),
    ]
    .map(|(key, a, b)| (key, tensor[(a, b)]))
}

/// The element of an inertia tensor.
pub fn inertia(tensor: &Matrix3<f64>) -> String {
    let entries = entries(tensor).map(|(key, value)| format!(" {key}=\"{}\"", numbers([value])));
    format!("<inertia{}/>", entries.concat())
}
