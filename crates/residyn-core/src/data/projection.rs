//! Linear regression on orthonormal columns: the part of a series that a basis explains, and the rest.

/// Orthogonal columns of unit length that span the same space; columns that the others already span are dropped.
pub(super) fn orthonormal(columns: impl IntoIterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = vec![];
    for column in columns {
        basis.extend(free_of(&basis, &column));
    }
    basis
}

/// The part of a series orthogonal to an orthonormal basis, scaled to unit length; `None` if nothing but rounding is
/// left.
pub(super) fn free_of(basis: &[Vec<f64>], series: &[f64]) -> Option<Vec<f64>> {
    let whole = dot(series, series).sqrt();
    let mut rest = series.to_vec();
    for column in basis {
        let share = dot(column, &rest);
        rest.iter_mut()
            .zip(column)
            .for_each(|(value, c)| *value -= share * c);
    }
    let length = dot(&rest, &rest).sqrt();
    if length <= 1e-6 * whole {
        return None;
    }
    rest.iter_mut().for_each(|value| *value /= length);
    Some(rest)
}

/// The part of a series that an orthonormal basis explains.
pub(super) fn explained_by<'b>(
    basis: impl IntoIterator<Item = &'b Vec<f64>>,
    series: &[f64],
) -> Vec<f64> {
    let mut part = vec![0.0; series.len()];
    for column in basis {
        let share = dot(column, series);
        part.iter_mut()
            .zip(column)
            .for_each(|(value, c)| *value += share * c);
    }
    part
}

/// The rest of the series.
pub(super) fn unexplained<'b>(
    basis: impl IntoIterator<Item = &'b Vec<f64>>,
    series: &[f64],
) -> Vec<f64> {
    difference(series, &explained_by(basis, series))
}

pub(super) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_series_is_orthogonal_to_the_basis() {
        let ramp: Vec<f64> = (0..50).map(f64::from).collect();
        let basis = orthonormal([vec![1.0; 50], ramp.clone(), vec![3.0; 50]]);
        assert_eq!(basis.len(), 2, "a column that others span is dropped");
        let series: Vec<f64> = ramp.iter().map(|x| 2.0 - 0.3 * x + (x * x).sin()).collect();
        let rest = unexplained(&basis, &series);
        assert!(basis.iter().all(|column| dot(column, &rest).abs() < 1e-9));
        // A straight line is explained entirely.
        let line: Vec<f64> = ramp.iter().map(|x| 2.0 - 0.3 * x).collect();
        assert!(
            unexplained(&basis, &line)
                .iter()
                .all(|rest| rest.abs() < 1e-9)
        );
    }
}
