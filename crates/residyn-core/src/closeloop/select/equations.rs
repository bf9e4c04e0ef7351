//! Normal equations of many values at once, some of them redundant.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::identify::{Fit, WindowTerms, step_within_bounds, submatrix, with_unit_diagonal};
use crate::model::Dynamics;

/// Smallest information on a direction, in units in which each value alone has 1: redundant items share it.
const RIDGE: f64 = 1e-9;

/// The solution of normal equations; `None` if the matrix is not positive definite.
pub fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let (scaled, unit) = ridged(matrix);
    let solution = scaled.cholesky()?.solve(&right.component_mul(&unit));
    Some(solution.component_mul(&unit))
}

/// A step of some free values of a fit to the minimum of its quadratic cost, and those of them that stay free: values at a
/// bound that would leave it are held. `step` gives the step of some values, `None` if it cannot be solved for.
pub fn step_from_bounds(
    dynamics: &Dynamics,
    fit: &Fit,
    values: Vec<usize>,
    step: impl Fn(&[usize]) -> Option<DVector<f64>>,
) -> Option<(Vec<usize>, DVector<f64>)> {
    let leaves = |i: usize, step: f64| {
        let parameter = &dynamics.parameters[fit.columns[i].parameter];
        let [low, high] = parameter.bounds;
        parameter.value <= low && step < 0.0 || parameter.value >= high && step > 0.0
    };
    step_within_bounds(values, step, leaves)
}

/// The values among these that no bound stops. Beside others they are free from the start: to find out for each choice
/// of others again that a value stays at its bound takes most of the time.
pub fn not_at_bounds(
    dynamics: &Dynamics,
    fit: &Fit,
    all: &WindowTerms,
    values: Vec<usize>,
) -> Vec<usize> {
    let step = |free: &[usize]| Some(-solve_among(all, free)?);
    let found = step_from_bounds(dynamics, fit, values.clone(), step);
    found.map_or(values, |(free, _)| free)
}

/// The solution of a part of normal equations.
pub fn solve_among(all: &WindowTerms, free: &[usize]) -> Option<DVector<f64>> {
    let matrix = submatrix(&all.hessian, free, free);
    solve(&matrix, &all.gradient.select_rows(free))
}

/// Normal equations in which some values, the base, are always free, and others now and then. The base is eliminated once: each
/// choice of the others then takes a matrix of its own size.
pub struct Eliminated {
    base: Vec<usize>,
    /// The size of each value's unit, in which the rest is stated.
    unit: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// How the base follows each value.
    along: DMatrix<f64>,
    /// What is left of the matrix.
    rest: DMatrix<f64>,
}

impl Eliminated {
    /// With the smallest information added; `None` if the matrix of the base is not positive definite.
    pub fn ridged(matrix: &DMatrix<f64>, base: &[usize]) -> Option<Self> {
        Self::of(ridged(matrix), base)
    }

    /// From a matrix in these units.
    pub fn of((matrix, unit): (DMatrix<f64>, DVector<f64>), base: &[usize]) -> Option<Self> {
        let all: Vec<usize> = (0..unit.len()).collect();
        let factor = submatrix(&matrix, base, base).cholesky()?;
        let with_base = submatrix(&matrix, base, &all);
        let along = factor.solve(&with_base);
        Some(Self {
            base: base.to_vec(),
            rest: matrix - with_base.tr_mul(&along),
            unit,
            factor,
            along,
        })
    }

    /// The solution for the base and these values, in the order of all, the others zero; `None` if their matrix is not
    /// positive definite.
    pub fn solve(&self, chosen: &[usize], right: &DVector<f64>) -> Option<DVector<f64>> {
        let right = right.component_mul(&self.unit);
        let of_base = right.select_rows(&self.base);
        let along = self.along.select_columns(chosen);
        let left = right.select_rows(chosen) - along.tr_mul(&of_base);
        let own = submatrix(&self.rest, chosen, chosen)
            .cholesky()?
            .solve(&left);
        let of_base = self.factor.solve(&of_base) - along * &own;
        let mut solution = DVector::zeros(self.unit.len());
        let base = self.base.iter().zip(of_base.iter());
        for (&value, found) in base.chain(chosen.iter().zip(own.iter())) {
            solution[value] = found * self.unit[value];
        }
        Some(solution)
    }

    /// The share of the information on each of these values that is left when the base and those before it are free; `None` if
    /// their matrix is not positive definite.
    pub fn own_shares(&self, chosen: &[usize]) -> Option<Vec<f64>> {
        let factor = submatrix(&self.rest, chosen, chosen).cholesky()?;
        let own = factor.l_dirty().diagonal();
        Some(own.iter().map(|own| own.powi(2)).collect())
    }
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
    use nalgebra::{DMatrix, DVector};

    use super::{Eliminated, solve};
    use crate::identify::submatrix;

    /// The second value repeats the first but for a hundredth, the third is apart from both.
    #[test]
    fn a_value_has_what_the_values_before_it_leave() {
        let rows = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 7.0]);
        let known = Eliminated::ridged(&(rows.transpose() * &rows), &[0]).unwrap();
        let shares = known.own_shares(&[1, 2]).unwrap();
        assert!((shares[0] - 0.01 / 1.01).abs() < 1e-6, "{shares:?}");
        assert!((shares[1] - 1.0).abs() < 1e-6, "{shares:?}");
        let singular = DMatrix::from_element(2, 2, f64::NAN);
        assert!(Eliminated::ridged(&singular, &[0]).is_none());
    }

    #[test]
    fn eliminated_values_change_no_solution() {
        let rows = DMatrix::from_fn(9, 5, |i, k| ((7 * i * i + 3 * k * k * i + k) % 13) as f64);
        let (matrix, right) = (
            rows.tr_mul(&rows),
            rows.tr_mul(&DVector::from_element(9, 1.0)),
        );
        let eliminated = Eliminated::ridged(&matrix, &[0, 2]).unwrap();
        for chosen in [vec![], vec![4], vec![3, 1]] {
            let found = eliminated.solve(&chosen, &right).unwrap();
            let all = [&[0, 2], chosen.as_slice()].concat();
            let wanted = solve(&submatrix(&matrix, &all, &all), &right.select_rows(&all)).unwrap();
            assert!(
                (found.select_rows(&all) - wanted).norm() < 1e-8,
                "{chosen:?}"
            );
            let others = found.norm_squared() - found.select_rows(&all).norm_squared();
            assert!(others.abs() < 1e-12);
        }
    }
}
