//! Orientations in all notations of the format.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::robot::element::Element;
use residyn_core::model::FileError;
use residyn_core::model::tree::turn;

/// Conventions for angles.
pub(super) struct Angles {
    in_degrees: bool,
    /// Three of `xyzXYZ`: lower case for intrinsic, upper case for extrinsic rotations.
    sequence: String,
}

pub(super) const WAYS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

impl Angles {
    pub fn new(compiler: &Element<'_, '_>) -> Result<Self, FileError> {
        let sequence = compiler.text("eulerseq").unwrap_or("xyz");
        if sequence.len() != 3 || !sequence.chars().all(|c| "xyzXYZ".contains(c)) {
            let message =
                format!("`eulerseq` must be three letters of xyzXYZ, found \"{sequence}\"");
            return Err(compiler.attribute_error("eulerseq", message));
        }
        Ok(Self {
            in_degrees: compiler.text("angle") != Some("radian"),
            sequence: sequence.to_owned(),
        })
    }

    /// An angle in rad; 0 if it is not given.
    pub fn angle(&self, element: &Element<'_, '_>, key: &str) -> Result<f64, FileError> {
        let angle = element.number_or(key, 0.0)?;
        Ok(if self.in_degrees {
            angle.to_radians()
        } else {
            angle
        })
    }

    /// The rotation of an element's frame, in whichever notation it is given.
    pub fn orientation(&self, element: &Element<'_, '_>) -> Result<Matrix3<f64>, FileError> {
        for part in element.parts() {
            let given: Vec<&str> = WAYS
                .into_iter()
                .filter(|way| part.text(way).is_some())
                .collect();
            match given[..] {
                [] => {}
                [way] => return self.given(&part, way),
                [_, second, ..] => {
                    let message = format!("`{second}` is a second orientation; give only one");
                    return Err(part.attribute_error(second, message));
                }
            }
        }
        Ok(Matrix3::identity())
    }

    fn given(&self, element: &Element<'_, '_>, way: &str) -> Result<Matrix3<f64>, FileError> {
        match way {
            "quat" => {
                let [w, x, y, z] = element.numbers(way)?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
                let quaternion = Quaternion::new(w, x, y, z);
                if quaternion.norm() < 1e-10 {
                    return Err(element.attribute_error(way, "`quat` has zero length"));
                }
                Ok(UnitQuaternion::from_quaternion(quaternion)
                    .to_rotation_matrix()
                    .into_inner())
            }
            "axisangle" => {
                let [x, y, z, angle] = self.in_rad::<4>(element, way)?;
                let axis = Vector3::new(x, y, z).try_normalize(1e-10);
                axis.map(|axis| turn(axis, angle))
                    .ok_or_else(|| element.attribute_error(way, "the axis has zero length"))
            }
            "euler" => Ok(self.euler(self.in_rad::<3>(element, way)?)),
            "xyaxes" => {
                let [a, b, c, d, e, f] = element.numbers(way)?.unwrap_or_default();
                let (x, y) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
                frame(x, y)
                    .ok_or_else(|| element.attribute_error(way, "the two axes do not span a plane"))
            }
            _ => Ok(from_z_to(element.direction(way, Vector3::z())?)),
        }
    }

    /// The numbers of an attribute, of which the last one or all are angles.
    fn in_rad<const N: usize>(
        &self,
        element: &Element<'_, '_>,
        key: &str,
    ) -> Result<[f64; N], FileError> {
        let given = element.numbers::<N>(key)?.unwrap_or([0.0; N]);
        let angles = if self.in_degrees {
            given.map(f64::to_radians)
        } else {
            element.angles::<N>(key)?.unwrap_or(given)
        };
        let first = if N == 4 { 3 } else { 0 };
        Ok(std::array::from_fn(|k| {
            if k < first { given[k] } else { angles[k] }
        }))
    }

    fn euler(&self, angles: [f64; 3]) -> Matrix3<f64> {
        let turns = self.sequence.chars().zip(angles);
        turns.fold(Matrix3::identity(), |before, (letter, angle)| {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x(),
                'y' => Vector3::y(),
                _ => Vector3::z(),
            };
            let next = turn(axis, angle);
            if letter.is_ascii_lowercase() {
                before * next
            } else {
                next * before
            }
        })
    }
}

/// The frame with x along `x` and y as close to `y` as possible.
fn frame(x: Vector3<f64>, y: Vector3<f64>) -> Option<Matrix3<f64>> {
    let x = x.try_normalize(1e-10)?;
    let y = (y - x * x.dot(&y)).try_normalize(1e-10)?;
    Some(Matrix3::from_columns(&[x, y, x.cross(&y)]))
}

/// The smallest rotation that takes z to a unit vector.
pub(super) fn from_z_to(direction: Vector3<f64>) -> Matrix3<f64> {
    let axis = Vector3::z().cross(&direction);
    match axis.try_normalize(1e-10) {
        Some(unit) => turn(unit, axis.norm().atan2(direction.z)),
        None if direction.z > 0.0 => Matrix3::identity(),
        None => turn(Vector3::x(), std::f64::consts::PI),
    }
}
