//! The inertia of simple solids.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::orientation::{Angles, from_z_to};
use crate::robot::element::Element;
use residyn_core::model::FileError;
use residyn_core::model::tree::{Inertia, Pose};

/// Default density, kg/m^3.
const DENSITY: f64 = 1000.0;

/// The inertia of a geom in the frame of its body.
pub(super) fn inertia(
    geom: &Element<'_, '_>,
    angles: &Angles,
    body: &str,
) -> Result<Inertia, FileError> {
    let (mass, density) = (
        geom.numbers::<1>("mass")?,
        geom.number_or("density", DENSITY)?,
    );
    let is_weightless = mass == Some([0.0]) || mass.is_none() && density == 0.0;
    let kind = geom.text("type").unwrap_or("sphere");
    if is_weightless || ["plane", "hfield"].contains(&kind) {
        return Ok(Inertia::none());
    }
    geom.refuse("shellinertia", &format!("give <inertial> in body `{body}`"))?;
    let ends = geom.numbers::<6>("fromto")?;
    let (pose, half_length) = match ends {
        Some(ends) => between(ends),
        None => {
            let pose = Pose {
                rotation: angles.orientation(geom)?,
                origin: geom.vector("pos")?,
            };
            (pose, None)
        }
    };
    let size = geom.list("size")?.unwrap_or_default();
    let side = |k: usize| {
        let given = size.get(k).copied().filter(|side| *side > 0.0);
        given.ok_or_else(|| {
            let sizes = k + 1;
            geom.error(format!(
                "a {kind} of body `{body}` needs {sizes} size(s) above zero"
            ))
        })
    };
    // Between two points the cross-section is round or square, and the points give the length.
    let sides = || match half_length {
        Some(half) => Ok([side(0)?, side(0)?, half]),
        None => Ok([side(0)?, side(1)?, side(2)?]),
    };
    let half = || half_length.map_or_else(|| side(1), Ok);
    let (volume, diagonal) = match kind {
        "sphere" => ellipsoid([side(0)?; 3]),
        "ellipsoid" => ellipsoid(sides()?),
        "box" => cuboid(sides()?),
        "cylinder" => cylinder(side(0)?, half()?),
        "capsule" => capsule(side(0)?, half()?),
        other => {
            let message = format!(
                "the inertia of a {other} is not computed; give <inertial> in body `{body}`, such as MuJoCo's mj_saveLastXML writes with saveinertial=\"true\""
            );
            return Err(geom.error(message));
        }
    };
    let mass = mass.map_or(density * volume, |[mass]| mass);
    Ok(Inertia::central(
        mass,
        Matrix3::from_diagonal(&(diagonal * mass)),
        &pose,
    ))
}

/// The frame midway between two points, z along their line, and half their distance.
fn between([a, b, c, d, e, f]: [f64; 6]) -> (Pose, Option<f64>) {
    let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
    let along = from - to;
    let direction = along.try_normalize(0.0).unwrap_or(Vector3::z());
    let pose = Pose {
        rotation: from_z_to(direction),
        origin: (from + to) * 0.5,
    };
    (pose, Some(0.5 * along.norm()))
}

/// Volume (m^3), and principal moments per mass (m^2).
type Solid = (f64, Vector3<f64>);

/// Principal moments per mass from the mean squares of the coordinates.
fn moments(squares: Vector3<f64>) -> Vector3<f64> {
    Vector3::repeat(squares.sum()) - squares
}

fn ellipsoid(radii: [f64; 3]) -> Solid {
    let [a, b, c] = radii;
    (
        4.0 / 3.0 * PI * a * b * c,
        moments(Vector3::from(radii).map(|r| r * r / 5.0)),
    )
}

fn cuboid(halves: [f64; 3]) -> Solid {
    let [a, b, c] = halves;
    (
        8.0 * a * b * c,
        moments(Vector3::from(halves).map(|h| h * h / 3.0)),
    )
}

fn cylinder(radius: f64, half: f64) -> Solid {
    let (r, h) = (radius * radius / 4.0, half * half / 3.0);
    (
        2.0 * PI * radius * radius * half,
        moments(Vector3::new(r, r, h)),
    )
}

/// A cylinder with a hemisphere on each end.
fn capsule(radius: f64, half: f64) -> Solid {
    let (tube, across) = cylinder(radius, half);
    let (ball, of_ball) = ellipsoid([radius; 3]);
    // The centre of mass of a hemisphere is 3/8 of the radius beyond the cylinder's end.
    let farther = half * half + 0.75 * half * radius;
    let caps = of_ball + Vector3::new(farther, farther, 0.0);
    let volume = tube + ball;
    (volume, (across * tube + caps * ball) / volume)
}
