//! What makes a motion good: a number that falls with the information that it gives, and its derivative.

use nalgebra::DMatrix;

use residyn_core::decomposition::eigen;

/// A cost of an information matrix and its derivative with respect to the matrix; `None` if the matrix is singular.
pub type Criterion = fn(&DMatrix<f64>) -> Option<(f64, DMatrix<f64>)>;

/// D-optimality: minus the mean logarithm of the eigenvalues, the volume of the parameters' joint interval.
pub fn log_determinant(information: &DMatrix<f64>) -> Option<(f64, DMatrix<f64>)> {
    let size = information.nrows().max(1) as f64;
    let factor = information.clone().cholesky()?;
    let log: f64 = factor
        .l_dirty()
        .diagonal()
        .iter()
        .map(|d| 2.0 * d.ln())
        .sum();
    let cost = -log / size;
    cost.is_finite()
        .then(|| (cost, factor.inverse() * (-1.0 / size)))
}

/// The logarithm of the regressor's condition number, which is the root of the matrix's (Gautier and Khalil, Exciting
/// trajectories for the identification of base inertial parameters of robots, 1992): kept for comparison.
pub fn log_condition(information: &DMatrix<f64>) -> Option<(f64, DMatrix<f64>)> {
    let eigen = eigen(information.clone())?;
    let (low, high) = (eigen.eigenvalues.imin(), eigen.eigenvalues.imax());
    let (least, most) = (eigen.eigenvalues[low], eigen.eigenvalues[high]);
    let part = |k: usize| {
        let vector = eigen.eigenvectors.column(k);
        vector * vector.transpose() / (2.0 * eigen.eigenvalues[k])
    };
    (least > 0.0).then(|| ((most / least).ln() / 2.0, part(high) - part(low)))
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::{Criterion, log_condition, log_determinant};

    #[test]
    fn derivatives_are_those_of_differences() {
        let matrix =
            DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0]);
        for criterion in [log_determinant as Criterion, log_condition] {
            let (_, slope) = criterion(&matrix).unwrap();
            for (i, j) in [(0, 0), (1, 1), (0, 2)] {
                let shifted = |by: f64| {
                    let mut matrix = matrix.clone();
                    matrix[(i, j)] += by;
                    if i != j {
                        matrix[(j, i)] += by;
                    }
                    criterion(&matrix).unwrap().0
                };
                let expected = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
                let both = if i == j { 1.0 } else { 2.0 };
                assert!((both * slope[(i, j)] - expected).abs() < 1e-7);
            }
        }
    }
}
