use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

use super::normal_equations::with_unit_diagonal;

/// A direction with a smaller eigenvalue than this, where the diagonal is one, has none but by rounding.
const ROUNDING: f64 = 1e-12;
/// Sweeps per row after which a decomposition has failed; two or three are the rule.
const MOST_SWEEPS: usize = 100;

/// The eigenvalues and eigenvectors of a symmetric matrix; `None` where it is not finite, over which the iteration would
/// never end.
pub(super) fn eigen(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    if matrix.is_empty() {
        let eigenvalues = DVector::zeros(0);
        return Some(SymmetricEigen {
            eigenvectors: matrix,
            eigenvalues,
        });
    }
    let most = MOST_SWEEPS * matrix.nrows();
    let is_finite = matrix.iter().all(|value| value.is_finite());
    is_finite.then(|| SymmetricEigen::try_new(matrix, f64::EPSILON, most))?
}

/// v^T M^+ v: the squared Mahalanobis distance of values from zero under a covariance, without the directions in which they
/// have no spread; NaN where the matrix is not finite.
pub fn squared_distance(matrix: &DMatrix<f64>, values: &DVector<f64>) -> f64 {
    let (scaled, unit) = with_unit_diagonal(matrix);
    let Some(eigen) = eigen(scaled) else {
        return f64::NAN;
    };
    let along = eigen.eigenvectors.tr_mul(&values.component_mul(&unit));
    let directions = eigen.eigenvalues.iter().zip(along.iter());
    directions
        .filter(|(eigenvalue, _)| **eigenvalue > ROUNDING)
        .map(|(eigenvalue, value)| value * value / eigenvalue)
        .sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{eigen, squared_distance};

    #[test]
    fn a_matrix_that_is_not_finite_has_no_eigenvalues() {
        let found = eigen(DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0])).unwrap();
        assert!((found.eigenvalues.max() - 3.0).abs() < 1e-12);
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(eigen(DMatrix::from_row_slice(2, 2, &[1.0, bad, bad, 1.0])).is_none());
        }
        assert!(eigen(DMatrix::zeros(0, 0)).is_some());
    }

    #[test]
    fn distances_do_not_depend_on_units_and_leave_out_directions_without_spread() {
        let far = |scale: f64| {
            let covariance = DMatrix::from_row_slice(
                2,
                2,
                &[4.0, 2.0 * scale, 2.0 * scale, 9.0 * scale * scale],
            );
            squared_distance(&covariance, &DVector::from_vec(vec![1.0, scale]))
        };
        assert!((far(1.0) - 9.0 / 32.0).abs() < 1e-12 && (far(1e-9) - 9.0 / 32.0).abs() < 1e-9);
        let flat = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]);
        assert!((squared_distance(&flat, &DVector::from_vec(vec![1.0, 1.0])) - 1.0).abs() < 1e-12);
        assert!(
            squared_distance(
                &DMatrix::from_element(1, 1, f64::NAN),
                &DVector::from_vec(vec![1.0])
            )
            .is_nan()
        );
    }
}
