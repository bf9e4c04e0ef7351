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

/// Whether the logs distinguish the values after the first `base` from each other and from those: the share of the
/// information on each that is left when the values before it are free must exceed `least`.
pub fn distinguishes(matrix: &DMatrix<f64>, base: usize, least: f64) -> bool {
    let Some(factor) = ridged(matrix).0.cholesky() else {
        return false;
    };
    let own = factor.l_dirty().diagonal();
    own.iter().skip(base).all(|own| own.powi(2) > least)
}

/// A matrix with a unit diagonal and the smallest information added, and the size of each unit.
fn ridged(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let (mut scaled, unit) = with_unit_diagonal(matrix);
    for i in 0..unit.len() {
        scaled[(i, i)] += RIDGE;
    }
    (scaled, unit)
}
