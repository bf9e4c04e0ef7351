//! Writes values into an existing file and leaves the rest of it unchanged.

use std::path::Path;

use nalgebra::Matrix3;
use roxmltree::Node;

use super::read::Robot;
use crate::robot::edit::{Edit, same};
use crate::robot::mechanism::numbers;
use crate::robot::write_back::{Change, body, is_some};
use crate::xml::{self, Source, named};
use residyn_core::model::FileError;
use residyn_core::model::chain::{Drivetrain, Inertia};

/// The text of the file at `path` with these changes.
///
/// # Errors
/// A file that cannot be read, or values that no body can have.
pub fn rewrite(path: &Path, changes: &[Change]) -> Result<String, FileError> {
    let text = xml::text(path)?;
    let source = Source::new(path, &text)?;
    let robot = Robot::new(&source)?;
    let mut edit = Edit::of(&text);
    for change in changes {
        let joint = robot.joint(&change.joint)?;
        write_dynamics(&source, &mut edit, joint, &change.drivetrain)?;
        if is_some(&change.added) {
            write_inertia(&robot, &mut edit, robot.end(joint, "child")?, &change.added)?;
        }
    }
    Ok(edit.finished())
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
        edit.insert(link, &inertial_text(&whole, centre.as_slice(), &tensor));
        return Ok(());
    };
    let part = |name| named(inertial, name).next();
    let turn = robot.pose(inertial)?.rotation;
    match part("origin") {
        Some(origin) => edit.set(origin, "xyz", centre.as_slice()),
        None => edit.insert(
            inertial,
            &format!("<origin xyz=\"{}\"/>", numbers(centre.iter().copied())),
        ),
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

fn inertial_text(whole: &Inertia, centre: &[f64], tensor: &Matrix3<f64>) -> String {
    let inertia = entries(tensor).map(|(key, value)| format!(" {key}=\"{}\"", numbers([value])));
    format!(
        "<inertial><origin xyz=\"{}\"/><mass value=\"{}\"/><inertia{}/></inertial>",
        numbers(centre.iter().copied()),
        numbers([whole.mass]),
        inertia.concat()
    )
}
