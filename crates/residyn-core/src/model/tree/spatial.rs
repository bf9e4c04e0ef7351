//! Frames, and the inertia of rigid bodies in them.

use nalgebra::{Matrix3, Vector3};

use crate::decomposition::eigen;

/// A frame relative to another: x in this frame is `rotation * x + origin` in the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    pub rotation: Matrix3<f64>,
    /// m
    pub origin: Vector3<f64>,
}

impl Pose {
    /// The reference frame itself.
    pub fn identity() -> Self {
        Self {
            rotation: Matrix3::identity(),
            origin: Vector3::zeros(),
        }
    }

    /// The frame `inner`, given in this frame, expressed in this frame's reference frame.
    #[must_use]
    pub fn then(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            origin: self.rotation * inner.origin + self.origin,
        }
    }

    /// The reference frame in this one.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let back = self.rotation.transpose();
        Self {
            rotation: back,
            origin: -(back * self.origin),
        }
    }
}

/// The rotation by `angle` (rad) about a unit vector. Quarter turns are exact.
pub fn turn(axis: Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (sin, cos) = (exact(angle.sin()), exact(angle.cos()));
    Matrix3::identity() * cos + axis.cross_matrix() * sin + axis * axis.transpose() * (1.0 - cos)
}

/// In floating point, sines of multiples of pi differ from 0 by about 1e-16.
fn exact(sine: f64) -> f64 {
    if sine.abs() < 1e-15 { 0.0 } else { sine }
}

/// The rotation of a frame whose z is `axis` (a unit vector). Its x is the next coordinate axis, made perpendicular, so that
/// a coordinate axis gives a permutation.
pub fn with_z_along(axis: Vector3<f64>) -> Matrix3<f64> {
    let next = Vector3::ith((axis.iamax() + 1) % 3, 1.0);
    let x = (next - axis * axis.dot(&next)).normalize();
    Matrix3::from_columns(&[x, axis.cross(&x), axis])
}

/// Number of inertial parameters of a body.
pub(crate) const PARTS: usize = 10;

/// The inertial parameters of a body: mass, first moments, and the [`TENSOR`].
pub(crate) type Parts = [f64; PARTS];

/// The entries of the inertia tensor among the parts: xx, xy, xz, yy, yz, zz.
pub(crate) const TENSOR: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Mass properties of a rigid body about the origin of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia {
    /// kg
    pub mass: f64,
    /// Mass times centre of mass, kg m.
    pub moment: Vector3<f64>,
    /// About the origin, kg m^2.
    pub tensor: Matrix3<f64>,
}

impl Inertia {
    /// A body without mass.
    pub fn none() -> Self {
        Self {
            mass: 0.0,
            moment: Vector3::zeros(),
            tensor: Matrix3::zeros(),
        }
    }

    /// Mass, first moments, and xx, xy, xz, yy, yz, zz of the tensor.
    ///
    /// # Panics
    /// When there are not ten parts.
    pub fn of_parts(parts: &[f64]) -> Self {
        let [mass, x, y, z, xx, xy, xz, yy, yz, zz] = parts.try_into().expect("ten parts");
        Self {
            mass,
            moment: Vector3::new(x, y, z),
            tensor: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        }
    }

    /// Mass, first moments, and xx, xy, xz, yy, yz, zz of the tensor.
    pub(super) fn parts(&self) -> Parts {
        let tensor = TENSOR.map(|at| self.tensor[at]);
        std::array::from_fn(|part| match part {
            0 => self.mass,
            1..4 => self.moment[part - 1],
            _ => tensor[part - 4],
        })
    }

    /// A body whose tensor (kg m^2) is given about its centre of mass, in the frame that `pose` puts there.
    pub fn central(mass: f64, tensor: Matrix3<f64>, pose: &Pose) -> Self {
        let here = Self {
            mass,
            moment: Vector3::zeros(),
            tensor,
        };
        here.seen_from(pose)
    }

    /// The same body in the reference frame of `pose`, which gives the body's frame there.
    #[must_use]
    pub fn seen_from(&self, pose: &Pose) -> Self {
        let (p, turned) = (pose.origin, pose.rotation * self.moment);
        let tensor = pose.rotation * self.tensor * pose.rotation.transpose();
        Self {
            mass: self.mass,
            moment: turned + p * self.mass,
            tensor: tensor + spread(&p, &p) * self.mass + spread(&p, &turned) + spread(&turned, &p),
        }
    }

    /// The centre of mass (m), and the tensor about it (kg m^2).
    pub fn about_centre(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let centre = self.moment / self.mass;
        let back = Pose {
            rotation: Matrix3::identity(),
            origin: -centre,
        };
        let tensor = self.seen_from(&back).tensor;
        (centre, (tensor + tensor.transpose()) * 0.5)
    }

    /// Two bodies that move as one.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            moment: self.moment + other.moment,
            tensor: self.tensor + other.tensor,
        }
    }
}

/// (a . b) I - a b^T: the inertia tensor of a unit mass at a for b = a.
fn spread(a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * a.dot(b) - a * b.transpose()
}

/// Why no body can have this inertia tensor (kg m^2) about its centre of mass, if so.
pub fn fault(tensor: &Matrix3<f64>) -> Option<&'static str> {
    let Some(eigen) = eigen(*tensor) else {
        return Some("is not finite");
    };
    let mut principal: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    principal.sort_by(f64::total_cmp);
    let rounding = 1e-6 * principal[2].abs();
    if principal[0] < -rounding {
        Some("has a negative principal moment")
    } else if principal[0] + principal[1] < principal[2] - rounding {
        Some("has a principal moment that is larger than the sum of the others")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use nalgebra::{Matrix3, Vector3};

    use super::{Inertia, Pose, fault, turn, with_z_along};

    #[test]
    fn quarter_turns_are_exact() {
        let quarter = turn(Vector3::z(), FRAC_PI_2);
        assert_eq!(quarter * Vector3::x(), Vector3::y());
        assert_eq!(turn(Vector3::x(), PI) * Vector3::y(), -Vector3::y());
    }

    #[test]
    fn a_frame_along_an_outer_axis_permutes_the_axes() {
        assert_eq!(with_z_along(Vector3::z()), Matrix3::identity());
        let along_y = with_z_along(Vector3::y());
        assert_eq!(along_y * Vector3::z(), Vector3::y());
        assert_eq!(along_y * Vector3::x(), Vector3::z());
        let skew = with_z_along(Vector3::new(0.6, -0.64, 0.48));
        assert!((skew.determinant() - 1.0).abs() < 1e-15);
        assert!((skew * skew.transpose() - Matrix3::identity()).norm() < 1e-15);
    }

    #[test]
    fn inertia_there_and_back_is_the_same() {
        let pose = Pose {
            rotation: turn(Vector3::new(0.36, 0.48, 0.8), 0.7),
            origin: Vector3::new(0.1, -0.2, 0.3),
        };
        let body = Inertia::central(
            2.0,
            Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.25)),
            &pose,
        );
        let back = body.seen_from(&pose.inverse());
        assert!(back.moment.norm() < 1e-15);
        assert!((back.tensor[(1, 1)] - 0.2).abs() < 1e-15);
        // Steiner: 2 kg at (0.1, -0.2, 0.3).
        let trace = 0.55 + 2.0 * 2.0 * 0.14;
        assert!((body.tensor.trace() - trace).abs() < 1e-14);
    }

    #[test]
    fn impossible_inertia_tensors_are_reported() {
        let tensor = |x, y, z| Matrix3::from_diagonal(&Vector3::new(x, y, z));
        assert_eq!(fault(&tensor(0.1, 0.2, 0.3)), None);
        assert!(fault(&tensor(0.1, 0.2, 0.31)).unwrap().contains("sum"));
        assert!(fault(&tensor(-0.1, 0.2, 0.2)).unwrap().contains("negative"));
    }
}
