use nalgebra::{Cholesky, Matrix4, SMatrix, SVector, SymmetricEigen};

use crate::decomposition::eigen;

/// Eigenvalues of a declared pseudo-inertia below this share of its largest are raised to it: a body of no extent has
/// none of its own kind near it.
const LEAST_SHARE: f64 = 1e-6;

/// Number of inertial parameters of a body: mass, first moments, and xx, xy, xz, yy, yz, zz of the tensor.
pub const PARTS: usize = 10;

/// The prior of a declared body: its values are physical, and near the declared ones.
///
/// A body's ten inertial parameters are physical if its pseudo-inertia, a symmetric 4x4 matrix P linear in them, is
/// positive definite. The cost of values is the relative entropy between the densities that P and the declared P0
/// belong to, -log det(P P0^-1) + tr(P0^-1 P) - 4: it does not depend on frames or units, is convex, and infinite if a
/// body is not physical (Lee, Wensing, Park, Geometric robot dynamic identification, IEEE T-RO 2020).
#[derive(Debug, Clone)]
pub struct DeclaredBody {
    /// The model's parameters, in the order of the parts.
    pub parameters: [usize; PARTS],
    inverse: Matrix4<f64>,
    log_determinant: f64,
}

impl DeclaredBody {
    /// A body with these declared values; `None` for one without mass and extent.
    pub fn new(parameters: [usize; PARTS], declared: &[f64; PARTS]) -> Option<Self> {
        let root = Cholesky::new(physical(&pseudo(declared))?)?;
        Some(Self {
            parameters,
            inverse: root.inverse(),
            log_determinant: log_determinant(&root),
        })
    }

    /// The relative entropy.
    pub fn cost(&self, values: &[f64; PARTS]) -> f64 {
        let inertia = pseudo(values);
        Cholesky::new(inertia).map_or(f64::INFINITY, |root| {
            let block = (self.inverse * inertia).trace();
            block - 4.0 - (log_determinant(&root) - self.log_determinant)
        })
    }

    /// Its gradient and second derivatives; `None` if the values are not physical.
    pub fn terms(
        &self,
        values: &[f64; PARTS],
    ) -> Option<(SVector<f64, PARTS>, SMatrix<f64, PARTS, PARTS>)> {
        let inverse = Cholesky::new(pseudo(values))?.inverse();
        let units = std::array::from_fn::<_, PARTS, _>(unit);
        let moved = units.map(|unit| inverse * unit);
        let slope = |k: usize| (self.inverse * units[k]).trace() - moved[k].trace();
        Some((
            SVector::from_fn(|k, _| slope(k)),
            SMatrix::from_fn(|k, l| (moved[k] * moved[l]).trace()),
        ))
    }
}

/// The values of the physical body nearest to these in the pseudo-inertia's eigenvalues; `None` for a body without mass
/// and extent.
pub fn physical_parts(parts: &[f64; PARTS]) -> Option<[f64; PARTS]> {
    let inertia = physical(&pseudo(parts))?;
    let second = inertia.fixed_view::<3, 3>(0, 0);
    let tensor = |a: usize, b: usize| {
        let of_all = if a == b { second.trace() } else { 0.0 };
        of_all - second[(a, b)]
    };
    let moment = inertia.fixed_view::<3, 1>(0, 3);
    Some([
        inertia[(3, 3)],
        moment[0],
        moment[1],
        moment[2],
        tensor(0, 0),
        tensor(0, 1),
        tensor(0, 2),
        tensor(1, 1),
        tensor(1, 2),
        tensor(2, 2),
    ])
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

fn log_determinant(root: &Cholesky<f64, nalgebra::Const<4>>) -> f64 {
    2.0 * root.l_dirty().diagonal().map(f64::ln).sum()
}

/// Second moments of the mass and, in the last row and column, its first moments and the mass itself.
fn pseudo(parts: &[f64; PARTS]) -> Matrix4<f64> {
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
            let (a, b) = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)][part - 4];
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
    use super::{DeclaredBody, PARTS, physical_parts};

    /// 2 kg about (0.1, -0.05, 0.2) m.
    const BODY: [f64; PARTS] = [2.0, 0.2, -0.1, 0.4, 0.12, 0.01, -0.035, 0.13, 0.02, 0.04];

    #[test]
    fn the_declared_body_costs_nothing_and_any_other_costs_more() {
        let declared = DeclaredBody::new([0; PARTS], &BODY).unwrap();
        assert!(declared.cost(&BODY).abs() < 1e-12);
        for k in 0..PARTS {
            let mut other = BODY;
            other[k] *= 1.01;
            assert!(declared.cost(&other) > 1e-6, "{k}");
        }
        let mut impossible = BODY;
        impossible[9] = 0.3;
        assert_eq!(declared.cost(&impossible), f64::INFINITY);
    }

    #[test]
    fn derivatives_are_those_of_the_cost() {
        let declared = DeclaredBody::new([0; PARTS], &BODY).unwrap();
        let at = BODY.map(|part| 1.02 * part + 1e-3);
        let (gradient, hessian) = declared.terms(&at).unwrap();
        for k in 0..PARTS {
            let moved = |step: f64| {
                let mut parts = at;
                parts[k] += step;
                parts
            };
            let h = 1e-6;
            let slope = (declared.cost(&moved(h)) - declared.cost(&moved(-h))) / (2.0 * h);
            assert!(
                (gradient[k] - slope).abs() < 1e-4 * (1.0 + slope.abs()),
                "{k}"
            );
            let after = declared.terms(&moved(h)).unwrap().0;
            let before = declared.terms(&moved(-h)).unwrap().0;
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
        assert!(
            DeclaredBody::new([0; PARTS], &body)
                .unwrap()
                .cost(&body)
                .is_finite()
        );
        assert!((body[9] - 0.3).abs() < 0.2, "{body:?}");
        assert_eq!(physical_parts(&[0.0; PARTS]), None);
        let same = physical_parts(&BODY).unwrap();
        assert!(same.iter().zip(BODY).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
