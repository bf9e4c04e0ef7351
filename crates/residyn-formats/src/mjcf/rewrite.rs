//! Writes values into an existing file and leaves the rest of it unchanged.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::orientation::WAYS;
use super::read::{Reader, linear};
use crate::robot::edit::{Edit, same};
use crate::robot::mechanism::numbers;
use crate::robot::write_back::{Change, body, is_some};
use crate::xml::{Source, named};
use residyn_core::model::FileError;
use residyn_core::model::tree::{Drivetrain, Inertia};

/// Add the edits that make these changes to the file.
///
/// # Errors
/// Joints without names, or values that no body can have.
pub fn rewrite(
    source: &Source<'_>,
    edit: &mut Edit<'_>,
    changes: &[Change],
) -> Result<(), FileError> {
    let reader = Reader::new(source)?;
    for change in changes {
        let joint = reader.joint(&change.joint)?;
        write_joint(&reader, edit, joint, &change.drivetrain)?;
        let body = joint.parent_element();
        if let Some(body) = body.filter(|_| is_some(&change.added)) {
            write_inertia(&reader, edit, body, &change.added)?;
        }
    }
    Ok(())
}

fn write_joint<'s>(
    reader: &Reader<'s, '_>,
    edit: &mut Edit<'_>,
    joint: Node<'s, '_>,
    wanted: &Drivetrain,
) -> Result<(), FileError> {
    let given = reader.element(joint)?;
    let values = [
        ("damping", linear(&given, "damping")?, wanted.damping),
        (
            "frictionloss",
            given.not_negative("frictionloss")?,
            wanted.friction,
        ),
        ("armature", given.not_negative("armature")?, wanted.armature),
    ];
    for (key, _, value) in values
        .iter()
        .filter(|(_, given, value)| !same(*given, *value))
    {
        edit.set(joint, key, &[*value]);
    }
    Ok(())
}

fn write_inertia<'s>(
    reader: &Reader<'s, '_>,
    edit: &mut Edit<'_>,
    of: Node<'s, '_>,
    added: &Inertia,
) -> Result<(), FileError> {
    if reader.inertia_from_geom == "true" {
        let message = "`inertiafromgeom` takes every inertia from geoms; set it to \"auto\", which gives <inertial> precedence";
        return Err(reader.source.error(of, message));
    }
    let class = reader.class_of(of);
    let name = of.attribute("name").unwrap_or_default();
    let whole = reader.inertia(of, class, name)?.with(added);
    let (centre, tensor) = body(reader.source, of, &whole)?;
    let Some(given) = named(of, "inertial").next() else {
        edit.insert(of, &inertial(&centre, whole.mass, &tensor));
        return Ok(());
    };
    edit.set(given, "pos", centre.as_slice());
    edit.set(given, "mass", &[whole.mass]);
    let turn = reader.angles.orientation(&reader.source.element(given))?;
    let own = turn.transpose() * tensor * turn;
    let beside = own - Matrix3::from_diagonal(&own.diagonal());
    if given.has_attribute("diaginertia") && beside.norm() <= 1e-12 * own.norm() {
        edit.set(given, "diaginertia", own.diagonal().as_slice());
    } else {
        // The axes of a full tensor are those of the body.
        for key in WAYS.into_iter().chain(["diaginertia"]) {
            edit.remove(given, key);
        }
        edit.set(given, "fullinertia", &entries(&tensor));
    }
    Ok(())
}

/// The element of a body's inertia: its centre of mass, mass, and the tensor about it.
pub fn inertial(centre: &Vector3<f64>, mass: f64, tensor: &Matrix3<f64>) -> String {
    format!(
        "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
        numbers(centre),
        numbers([mass]),
        numbers(entries(tensor))
    )
}

/// In the order of `fullinertia`.
fn entries(tensor: &Matrix3<f64>) -> [f64; 6] {
    [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|at| tensor[at])
}
