//! The table `[chain]` of a model file: which link each link sits on and where, what moves it, and its inertia.

use nalgebra::{Matrix3, Vector3};

use super::bodies::Bodies;
use super::reader::{FileError, Located};
use super::sections;
use super::tables::{ChainTable, LinkTable};
use super::tree::{Body, Place, Pose};
use crate::data::Joint;
use crate::expr::Formula;

/// Directions within this angle (rad) of being parallel give no frame.
const PARALLEL: f64 = 1e-6;

pub(super) fn bodies(chain: ChainTable<'_>, prismatic: &[bool]) -> Result<Bodies, FileError> {
    let links = chain.link;
    let places = (links.iter().enumerate()).map(|(k, link)| place(k, link, prismatic));
    let places: Vec<Place> = places.collect::<Result<_, _>>()?;
    let moves = |joint: &Joint| places.iter().any(|place| place.joint == *joint);
    if let Some(still) = Joint::all(prismatic.len()).find(|joint| !moves(joint)) {
        let message = format!("no [[chain.link]] has `joint = {still}`; each joint needs one");
        return Err(chain.section.error(message));
    }
    Ok(Bodies {
        gravity: chain.gravity,
        places,
        bodies: links.into_iter().map(body).collect(),
    })
}

/// `origin`, `axis` (z) and `across` (x) of the frame of the link at place `k`, in the frame of the link that it sits on,
/// and what moves it.
fn place(k: usize, link: &LinkTable<'_>, prismatic: &[bool]) -> Result<Place, FileError> {
    let axis = direction(link, "axis", link.axis)?;
    let across = direction(link, "across", link.across)?;
    let x = across - axis * axis.dot(&across);
    if x.norm() < PARALLEL {
        let message = "`across` is parallel to `axis`; give a direction across it";
        return Err(link.section.error_at("across", message));
    }
    let x = x.normalize();
    let joint = sections::joint(&link.section, link.joint, prismatic.len())?;
    Ok(Place {
        parent: parent(k, link)?,
        pose: Pose {
            rotation: Matrix3::from_columns(&[x, axis.cross(&x), axis]),
            origin: link.origin.into(),
        },
        slides: link.slides.unwrap_or(prismatic[joint]),
        joint,
        ratio: link.ratio.unwrap_or(1.0),
        offset: link.offset.unwrap_or(0.0),
    })
}

/// The link with the number `parent`, or the one before; the base is 0.
fn parent(k: usize, link: &LinkTable<'_>) -> Result<Option<usize>, FileError> {
    let on = link.parent.unwrap_or(k);
    if on > k {
        let message = format!(
            "`parent` must be the number of a link further up, at most {k}, or 0 for the base; found {on}"
        );
        return Err(link.section.error_at("parent", message));
    }
    Ok(on.checked_sub(1))
}

fn direction(link: &LinkTable<'_>, key: &str, given: [f64; 3]) -> Result<Vector3<f64>, FileError> {
    let direction = Vector3::from(given).try_normalize(0.0);
    let message = || format!("`{key}` must be a direction, found zeros");
    direction.ok_or_else(|| link.section.error_at(key, message()))
}

fn body(link: LinkTable<'_>) -> Body<Located<Formula>> {
    Body {
        mass: link.mass,
        moment: link.moment,
        tensor: link.inertia,
    }
}
