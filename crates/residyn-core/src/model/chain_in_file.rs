//! The table `[chain]` of a model file: where each link sits on the previous one, what moves it, and its inertia.

use nalgebra::{Matrix3, Vector3};

use super::bodies::Bodies;
use super::chain::{Body, Place, Pose};
use super::reader::{Document, FileError, Located, Section};
use crate::data::Joint;
use crate::expr::Formula;

const KEYS: &[&str] = &[
    "joint", "ratio", "offset", "slides", "origin", "axis", "across", "mass", "moment", "inertia",
];
/// Directions within this angle (rad) of being parallel give no frame.
const PARALLEL: f64 = 1e-6;

pub(super) fn chain(
    document: &Document,
    section: &Section<'_>,
    prismatic: &[bool],
) -> Result<Bodies, FileError> {
    section.only(&["gravity", "link"])?;
    let links = section.sections("link")?;
    for link in &links {
        link.only(KEYS)?;
    }
    let places = links.iter().map(|link| place(link, prismatic));
    let places: Vec<Place> = places.collect::<Result<_, _>>()?;
    let moves = |joint: &Joint| places.iter().any(|place| place.joint == *joint);
    if let Some(still) = Joint::all(prismatic.len()).find(|joint| !moves(joint)) {
        let message = format!("no [[chain.link]] has `joint = {still}`; each joint needs one");
        return Err(section.error(message));
    }
    Ok(Bodies {
        gravity: formulas(document, section, "gravity")?,
        places,
        bodies: links
            .iter()
            .map(|link| body(document, link))
            .collect::<Result<_, _>>()?,
    })
}

/// `origin`, `axis` (z) and `across` (x) of the link's frame in the previous link's frame, and what moves it.
fn place(link: &Section<'_>, prismatic: &[bool]) -> Result<Place, FileError> {
    let axis = direction(link, "axis")?;
    let across = direction(link, "across")?;
    let x = across - axis * axis.dot(&across);
    if x.norm() < PARALLEL {
        let message = "`across` is parallel to `axis`; give a direction across it";
        return Err(link.error_at("across", message));
    }
    let x = x.normalize();
    let joint = link.whole("joint")?.and_then(Joint::numbered);
    let Some(joint) = joint.filter(|joint| joint.is_of(prismatic.len())) else {
        let message = format!("`joint` must be a number from 1 to {}", prismatic.len());
        return Err(link.error_at("joint", message));
    };
    Ok(Place {
        pose: Pose {
            rotation: Matrix3::from_columns(&[x, axis.cross(&x), axis]),
            origin: vector(link, "origin")?,
        },
        slides: if link.has("slides") {
            link.flag("slides")?
        } else {
            prismatic[joint]
        },
        joint,
        ratio: link.number("ratio")?.unwrap_or(1.0),
        offset: link.number("offset")?.unwrap_or(0.0),
    })
}

fn direction(link: &Section<'_>, key: &str) -> Result<Vector3<f64>, FileError> {
    let given = vector(link, key)?;
    given
        .try_normalize(0.0)
        .ok_or_else(|| link.error_at(key, format!("`{key}` must be a direction, found zeros")))
}

fn vector(link: &Section<'_>, key: &str) -> Result<Vector3<f64>, FileError> {
    match link.numbers(key)?.as_deref() {
        Some([x, y, z]) => Ok(Vector3::new(*x, *y, *z)),
        Some(_) => Err(link.error_at(key, format!("`{key}` must be a list of three numbers"))),
        None => Err(link.error(format!("`{key}` is missing; give three numbers"))),
    }
}

fn body(document: &Document, link: &Section<'_>) -> Result<Body<Located<Formula>>, FileError> {
    let missing = || link.error("`mass` is missing; give a formula");
    Ok(Body {
        mass: link.formula("mass")?.ok_or_else(missing)?,
        moment: formulas(document, link, "moment")?,
        tensor: formulas(document, link, "inertia")?,
    })
}

fn formulas<const N: usize>(
    document: &Document,
    section: &Section<'_>,
    key: &str,
) -> Result<[Located<Formula>; N], FileError> {
    let texts = section.texts(key)?.unwrap_or_default();
    if texts.len() != N {
        let message = format!("`{key}` must be a list of {N} formulas");
        return Err(section.error_at(key, message));
    }
    let formulas = texts.iter().map(|text| document.formula(text));
    let formulas: Vec<_> = formulas.collect::<Result<_, _>>()?;
    Ok(formulas.try_into().expect("as many as texts"))
}
