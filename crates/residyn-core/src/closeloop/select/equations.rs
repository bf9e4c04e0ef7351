//! Normal equations of many values at once, some of them redundant.

use nalgebra::{DMatrix, DVector};

use crate::identify::with_unit_diagonal;

/// Smallest information on a direction, in units in which each value alone has 1: redundant items share it.
const RIDGE: f64 = 1e-9;

/// The solution of normal equations; `None` if the matrix is not positive definite.
pub fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let (scaled, unit) = ridged(matrix);
    let solution = scaled.cholesky()?.solve(&right.component_mul(&unit));
    Some(solution.component_mul(&unit))
}

/// The share of the information on each value after the first `base` that is left when those before it are free; `None`
/// if the matrix is not positive definite.
pub fn own_shares(matrix: &DMatrix<f64>, base: usize) -> Option<Vec<f64>> {
    let factor = ridged(matrix).0.cholesky()?;
    let own = factor.l_dirty().diagonal();
    Some(own.iter().skip(base).map(|own| own.powi(2)).collect())
}

/// A matrix with a unit diagonal and the smallest information added, and the size of each unit.
fn ridged(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let (mut scaled, unit) = with_unit_diagonal(matrix);
    for i in 0..unit.len() {
        scaled[(i, i)] += RIDGE;
    }
    (scaled, unit)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::own_shares;

    /// The second value repeats the first but for a hundredth, the third is apart from both.
    #[test]
    fn a_value_has_what_the_values_before_it_leave() {
        let rows = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 7.0]);
        let shares = own_shares(&(rows.transpose() * &rows), 1).unwrap();
        assert!((shares[0] - 0.01 / 1.01).abs() < 1e-6, "{shares:?}");
        assert!((shares[1] - 1.0).abs() < 1e-6, "{shares:?}");
        let singular = DMatrix::from_element(2, 2, f64::NAN);
        assert_eq!(own_shares(&singular, 0), None);
    }
}
