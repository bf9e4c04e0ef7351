//! The pseudo-inertia of a body: the second moments of its mass over (x, y, z, 1), linear in its inertial parameters.
//!
//! It is positive definite if and only if a body can have these parameters, and two bodies differ by the relative
//! entropy of the densities that it belongs to, which does not depend on frames or units (Lee, Wensing and Park,
//! Geometric robot dynamic identification, IEEE T-RO 2020).

use nalgebra::{Cholesky, Const, Matrix4, SMatrix, SVector, SymmetricEigen};

use super::spatial::{PARTS, Parts, TENSOR};
use crate::decomposition::eigen;

/// Eigenvalues of a pseudo-inertia below this share of its largest are raised to it: a body of no extent has none of
/// its own kind near it.
const LEAST_SHARE: f64 = 1e-6;

/// How far bodies are from a given one with the pseudo-inertia P0: -log det(P P0^-1) + tr(P0^-1 P) - 4. It is convex,
/// and infinite for parts that no body has.
#[derive(Debug, Clone)]
pub(crate) struct Divergence {
    inverse: Matrix4<f64>,
    log_determinant: f64,
}

impl Divergence {
    /// From the body with these parts; `None` if no body has them.
    pub fn from_body(parts: &Parts) -> Option<Self> {
        Self::from(pseudo(parts))
    }

    /// From the body nearest to these parts, as [`physical_parts`] finds it.
    pub fn from_nearest_body(parts: &Parts) -> Option<Self> {
        Self::from(physical(&pseudo(parts))?)
    }

    fn from(inertia: Matrix4<f64>) -> Option<Self> {
        let root = Cholesky::new(inertia)?;
        Some(Self {
            inverse: root.inverse(),
            log_determinant: log_determinant(&root),
        })
    }

    /// The divergence of a body with these parts.
    pub fn of(&self, parts: &Parts) -> f64 {
        let inertia = pseudo(parts);
        Cholesky::new(inertia).map_or(f64::INFINITY, |root| {
            let block = (self.inverse * inertia).trace();
            block - 4.0 - (log_determinant(&root) - self.log_determinant)
        })
    }

    /// Its gradient and second derivatives; `None` if no body has these parts.
    pub fn terms(
        &self,
        parts: &Parts,
    ) -> Option<(SVector<f64, PARTS>, SMatrix<f64, PARTS, PARTS>)> {
        let inverse = Cholesky::new(pseudo(parts))?.inverse();
        let units = std::array::from_fn::<_, PARTS, _>(unit);
        let moved = units.map(|unit| inverse * unit);
        let slope = |k: usize| (self.inverse * units[k]).trace() - moved[k].trace();
        Some((
            SVector::from_fn(|k, _| slope(k)),
            SMatrix::from_fn(|k, l| (moved[k] * moved[l]).trace()),
        ))
    }
}

/// Whether a body can have these parts.
pub(crate) fn is_physical(parts: &Parts) -> bool {
    Cholesky::new(pseudo(parts)).is_some()
}

/// The parts of the body nearest to these in the pseudo-inertia's eigenvalues; `None` for a body without mass and
/// extent.
pub(crate) fn physical_parts(parts: &Parts) -> Option<Parts> {
    let inertia = physical(&pseudo(parts))?;
    let trace = inertia.fixed_view::<3, 3>(0, 0).trace();
    Some(std::array::from_fn(|part| match part {
        0 => inertia[(3, 3)],
        1..4 => inertia[(part - 1, 3)],
        _ => {
            let (a, b) = TENSOR[part - 4];
            let of_all = if a == b { trace } else { 0.0 };
            of_all - inertia[(a, b)]
        }
    }))
}

/// A positive definite matrix with these eigenvectors.
fn physical(inertia: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let SymmetricEigen {
        eigenvalues,
        eigenvectors,
    } = eigen(*inertia)?;
    let least = LEAST_SHARE * eigenvalues.max();
    let raised = Matrix4::from_diagonal(&eigenvalues.map(|value| value.max(least)));
    (least > 0.0).then(|| eigenvectors * raised * eigenvectors.transpose())
}

fn log_determinant(root: &Cholesky<f64, Const<4>>) -> f64 {
    2.0 * root.l_dirty().diagonal().map(f64::ln).sum()
}

/// Second moments of the mass and, in the last row and column, its first moments and the mass itself.
fn pseudo(parts: &Parts) -> Matrix4<f64> {
    let weighed = (0..PARTS).map(|k| unit(k) * parts[k]);
    weighed.sum()
}

/// The pseudo-inertia of a unit of one part.
fn unit(part: usize) -> Matrix4<f64> {
    let mut matrix = Matrix4::zeros();
    match part {
        0 => matrix[(3, 3)] = 1.0,
        1..4 => {
            (matrix[(part - 1, 3)], matrix[(3, part - 1)]) = (1.0, 1.0);
        }
        _ => {
            let (a, b) = TENSOR[part - 4];
            if a == b {
                // Half the trace of the tensor minus the tensor itself.
                for c in 0..3 {
                    matrix[(c, c)] = if c == a { -0.5 } else { 0.5 };
                }
            } else {
                (matrix[(a, b)], matrix[(b, a)]) = (-1.0, -1.0);
            }
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::{Divergence, PARTS, Parts, is_physical, physical_parts};

    /// 2 kg about (0.1, -0.05, 0.2) m.
    const BODY: Parts = [2.0, 0.2, -0.1, 0.4, 0.12, 0.01, -0.035, 0.13, 0.02, 0.04];

    fn from_body() -> Divergence {
        Divergence::from_nearest_body(&BODY).unwrap()
    }

    #[test]
    fn a_body_does_not_differ_from_itself_and_any_other_does() {
        assert!(from_body().of(&BODY).abs() < 1e-12);
        for k in 0..PARTS {
            let mut other = BODY;
            other[k] *= 1.01;
            assert!(from_body().of(&other) > 1e-6, "{k}");
        }
        let mut impossible = BODY;
        impossible[9] = 0.3;
        assert!(!is_physical(&impossible));
        assert_eq!(from_body().of(&impossible), f64::INFINITY);
    }

    #[test]
    fn derivatives_are_those_of_the_divergence() {
        let divergence = from_body();
        let at = BODY.map(|part| 1.02 * part + 1e-3);
        let (gradient, hessian) = divergence.terms(&at).unwrap();
        for k in 0..PARTS {
            let moved = |step: f64| {
                let mut parts = at;
                parts[k] += step;
                parts
            };
            let h = 1e-6;
            let slope = (divergence.of(&moved(h)) - divergence.of(&moved(-h))) / (2.0 * h);
            assert!(
                (gradient[k] - slope).abs() < 1e-4 * (1.0 + slope.abs()),
                "{k}"
            );
            let after = divergence.terms(&moved(h)).unwrap().0;
            let before = divergence.terms(&moved(-h)).unwrap().0;
            for l in 0..PARTS {
                let bend = (after[l] - before[l]) / (2.0 * h);
                assert!(
                    (hessian[(k, l)] - bend).abs() < 1e-3 * (1.0 + bend.abs()),
                    "{k} {l}"
                );
            }
        }
    }

    #[test]
    fn what_no_body_can_be_becomes_one() {
        // All of the mass in the joint, with an inertia about one axis only.
        let parts = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3];
        let body = physical_parts(&parts).unwrap();
        assert!(is_physical(&body));
        assert!((body[9] - 0.3).abs() < 0.2, "{body:?}");
        assert_eq!(physical_parts(&[0.0; PARTS]), None);
        let same = physical_parts(&BODY).unwrap();
        assert!(same.iter().zip(BODY).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
