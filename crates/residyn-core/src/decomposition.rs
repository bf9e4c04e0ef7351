//! Matrix decompositions that always end: nalgebra's never do if a number is not finite.

use nalgebra::allocator::Allocator;
use nalgebra::{
    DMatrix, DVector, DefaultAllocator, Dim, DimDiff, DimSub, OMatrix, SVD, SymmetricEigen, U1,
};

/// Sweeps per row or column after which a decomposition has failed; two or three are usual.
const MOST_SWEEPS: usize = 100;

/// The eigenvalues and eigenvectors of a symmetric matrix; `None` if it is not finite.
pub fn eigen<D>(matrix: OMatrix<f64, D, D>) -> Option<SymmetricEigen<f64, D>>
where
    D: Dim + DimSub<U1>,
    DefaultAllocator: Allocator<D, D> + Allocator<D> + Allocator<DimDiff<D, U1>>,
{
    if matrix.is_empty() {
        return Some(SymmetricEigen {
            eigenvalues: matrix.diagonal(),
            eigenvectors: matrix,
        });
    }
    let most = MOST_SWEEPS * matrix.nrows();
    let is_finite = matrix.iter().all(|value| value.is_finite());
    is_finite.then(|| SymmetricEigen::try_new(matrix, f64::EPSILON, most))?
}

/// The least-squares solution of `columns x = right`, the shortest one, without the directions whose singular value is
/// at most `rounding`; `None` if `columns` is not finite or empty.
pub fn least_squares(
    columns: DMatrix<f64>,
    right: &DVector<f64>,
    rounding: f64,
) -> Option<DVector<f64>> {
    if columns.is_empty() || !columns.iter().all(|value| value.is_finite()) {
        return None;
    }
    let most = MOST_SWEEPS * columns.ncols().max(columns.nrows());
    let svd = SVD::try_new(columns, true, true, 5.0 * f64::EPSILON, most)?;
    svd.solve(right, rounding).ok()
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Matrix3};

    use super::{eigen, least_squares};

    #[test]
    fn a_matrix_that_is_not_finite_has_no_eigenvalues() {
        let found = eigen(DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0])).unwrap();
        assert!((found.eigenvalues.max() - 3.0).abs() < 1e-12);
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(eigen(DMatrix::from_row_slice(2, 2, &[1.0, bad, bad, 1.0])).is_none());
            assert!(eigen(Matrix3::repeat(bad)).is_none());
        }
        assert!(eigen(DMatrix::zeros(0, 0)).is_some());
        for size in [1e-320, 1e308] {
            eigen(Matrix3::repeat(size));
        }
    }

    #[test]
    fn equations_of_numbers_that_are_not_finite_have_no_solution() {
        let columns = |size: f64| DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 1.0, size, 1.0, 2.0]);
        let right = DVector::from_vec(vec![1.0, 3.0, 5.0]);
        let found = least_squares(columns(1.0), &right, 0.0).unwrap();
        assert!((found - DVector::from_vec(vec![1.0, 2.0])).amax() < 1e-12);
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(least_squares(columns(bad), &right, 0.0).is_none());
        }
        assert!(least_squares(DMatrix::zeros(3, 0), &right, 0.0).is_none());
        for size in [1e-320, 1e308] {
            least_squares(DMatrix::repeat(3, 2, size), &right, 0.0);
        }
    }
}
