use nalgebra::DMatrix;

use crate::data::statistics::quantile;

/// Splines along a variable: cubic, on equidistant knots (Eilers and Marx 1996). Enough for the shapes of friction and
/// of a cogging torque; the penalty smooths the excess.
pub(super) const SPLINES: usize = 14;

/// Cubic splines over one variable, as functions whose mean over the samples is zero.
pub(super) struct Basis {
    low: f64,
    high: f64,
    /// `[sample, spline]`, centred.
    pub columns: DMatrix<f64>,
    /// The column means, subtracted to centre them.
    means: Vec<f64>,
}

impl Basis {
    /// `None` if the values do not differ.
    pub fn over(values: Vec<f64>, quantiles: [f64; 2]) -> Option<Self> {
        let [low, high] = quantiles.map(|share| quantile(&values, share));
        if !(high - low > 1e-9 * (1.0 + high.abs().max(low.abs()))) {
            return None;
        }
        let mut columns = DMatrix::zeros(values.len(), SPLINES);
        for (row, value) in values.iter().enumerate() {
            let splines = splines((value - low) / (high - low));
            columns.row_mut(row).copy_from_slice(&splines);
        }
        let means: Vec<f64> = columns.column_iter().map(|column| column.mean()).collect();
        for (mut column, mean) in columns.column_iter_mut().zip(&means) {
            column.add_scalar_mut(-mean);
        }
        Some(Self {
            low,
            high,
            columns,
            means,
        })
    }

    /// `count` equidistant values over the range of the basis.
    pub fn points(&self, count: usize) -> impl Iterator<Item = f64> {
        let place = move |point: usize| point as f64 / (count - 1) as f64;
        (0..count).map(move |point| self.low + place(point) * (self.high - self.low))
    }

    /// The centred splines at a value.
    pub fn at(&self, value: f64) -> impl Iterator<Item = f64> {
        let splines = splines((value - self.low) / (self.high - self.low));
        let both = splines.into_iter().zip(&self.means);
        both.map(|(b, mean)| b - mean)
    }
}

/// The cubic splines at a position from 0 to 1, constant beyond.
fn splines(place: f64) -> [f64; SPLINES] {
    let pieces = (SPLINES - 3) as f64;
    let at = pieces * place.clamp(0.0, 1.0);
    let piece = at.floor().min(pieces - 1.0);
    let u = at - piece;
    let v = 1.0 - u;
    let parts = [
        v.powi(3),
        3.0 * u.powi(3) - 6.0 * u * u + 4.0,
        3.0 * v.powi(3) - 6.0 * v * v + 4.0,
        u.powi(3),
    ];
    let mut all = [0.0; SPLINES];
    for (spline, part) in all[piece as usize..].iter_mut().zip(parts) {
        *spline = part / 6.0;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::splines;

    #[test]
    fn splines_sum_to_one() {
        for place in [0.0, 0.123, 0.5, 0.999, 1.0, 2.0] {
            assert!((splines(place).iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
