use nalgebra::{DMatrix, DVector};

use super::normal_equations::with_unit_diagonal;
use crate::decomposition::eigen;

/// With a unit diagonal, an eigenvalue smaller than this is rounding error.
const ROUNDING: f64 = 1e-12;
/// v^T M^+ v: the squared Mahalanobis distance of values from zero under a covariance, without the directions in which
/// they have no spread; NaN if the matrix is not finite.
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

    use super::squared_distance;

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
