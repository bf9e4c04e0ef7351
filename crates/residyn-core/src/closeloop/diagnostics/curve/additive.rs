use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::basis::{Basis, SPLINES};
use crate::closeloop::settings::CurveSettings;
use crate::data::statistics::{SIGMA_PER_MAD, upper_median};

/// An intercept and a smooth function of each variable, fitted together by penalised least squares.
pub(super) struct Additive {
    coefficients: DVector<f64>,
    covariance: DMatrix<f64>,
    /// 97.5 % quantile of Student's t, with one degree of freedom fewer than blocks.
    quantile: f64,
}

/// Normal equations of a part of the samples.
#[derive(Clone)]
struct Sums {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

impl Additive {
    /// `None` if the forces do not determine the curves.
    pub fn fit(
        bases: &[&Basis],
        forces: &DVector<f64>,
        blocks: &[usize],
        settings: &CurveSettings,
    ) -> Option<Self> {
        let rows = forces.len();
        let mut design = DMatrix::from_element(rows, 1 + SPLINES * bases.len(), 1.0);
        for (k, basis) in bases.iter().enumerate() {
            let mut own = design.columns_mut(1 + SPLINES * k, SPLINES);
            own.copy_from(&basis.columns);
        }
        let even = DVector::from_element(rows, 1.0);
        let first = Sums::by_block(&design, forces, &even, blocks);
        let penalties = smoothness(&first, bases.len(), rows, settings)?;
        let total = Sums::total(&first);
        let rough = solve(&total, &penalties)?.solve(&total.right);
        let weights = weights(&(forces - &design * rough), settings.huber_scales);
        let parts = Sums::by_block(&design, forces, &weights, blocks);
        let penalties = smoothness(&parts, bases.len(), rows, settings)?;
        let total = Sums::total(&parts);
        let coefficients = solve(&total, &penalties)?.solve(&total.right);
        let covariance = jackknife(&total, &parts, &penalties, &coefficients)?;
        let freedom = parts.len() as f64 - 1.0;
        let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
        Some(Self {
            coefficients,
            covariance,
            quantile: student.inverse_cdf(0.975),
        })
    }

    /// The force at a value of the k-th variable, without the contributions of the others, and the half width of its
    /// 95 % confidence band.
    pub fn at(&self, k: usize, basis: &Basis, x: f64) -> (f64, f64) {
        let mut row = DVector::zeros(self.coefficients.len());
        row[0] = 1.0;
        for (slot, value) in row.iter_mut().skip(1 + SPLINES * k).zip(basis.at(x)) {
            *slot = value;
        }
        let variance = row.dot(&(&self.covariance * &row));
        let half = self.quantile * variance.max(0.0).sqrt();
        (row.dot(&self.coefficients), half)
    }
}

impl Sums {
    fn by_block(
        design: &DMatrix<f64>,
        forces: &DVector<f64>,
        weights: &DVector<f64>,
        blocks: &[usize],
    ) -> Vec<Self> {
        let mut next = 0;
        (blocks.chunk_by(|a, b| a == b))
            .map(|block| {
                let (first, rows) = (next, block.len());
                next += rows;
                let x = design.rows(first, rows);
                let y = forces.rows(first, rows);
                let w = DMatrix::from_diagonal(&weights.rows(first, rows).into_owned());
                let weighted = w * x;
                Self {
                    matrix: weighted.tr_mul(&x),
                    right: weighted.tr_mul(&y),
                    square: weights.rows(first, rows).dot(&y.component_mul(&y)),
                }
            })
            .collect()
    }

    fn total(parts: &[Self]) -> Self {
        let mut total = parts[0].clone();
        for part in &parts[1..] {
            total.matrix += &part.matrix;
            total.right += &part.right;
            total.square += part.square;
        }
        total
    }

    fn without(&self, part: &Self) -> Self {
        Self {
            matrix: &self.matrix - &part.matrix,
            right: &self.right - &part.right,
            square: self.square - part.square,
        }
    }

    /// Squared error of coefficients on these samples.
    fn error(&self, coefficients: &DVector<f64>) -> f64 {
        self.square - 2.0 * coefficients.dot(&self.right)
            + coefficients.dot(&(&self.matrix * coefficients))
    }
}

/// The penalty of each variable that predicts left-out blocks best, by coordinate search.
fn smoothness(
    parts: &[Sums],
    variables: usize,
    rows: usize,
    settings: &CurveSettings,
) -> Option<DMatrix<f64>> {
    let (folds, penalties) = (settings.folds, &settings.penalty_exponents);
    let of_fold = |fold: usize| {
        let members: Vec<Sums> = parts.iter().skip(fold).step_by(folds).cloned().collect();
        Sums::total(&members)
    };
    let left_out: Vec<Sums> = (0..parts.len().min(folds)).map(of_fold).collect();
    let total = Sums::total(parts);
    let rests: Vec<Sums> = left_out.iter().map(|part| total.without(part)).collect();
    let error = |powers: &[i32]| -> f64 {
        let penalty = penalty(powers, rows);
        let error = |(rest, part): (&Sums, &Sums)| match solve(rest, &penalty) {
            Some(solver) => part.error(&solver.solve(&rest.right)),
            None => f64::INFINITY,
        };
        rests.iter().zip(&left_out).map(error).sum()
    };
    let mut powers = vec![penalties[penalties.len() / 2]; variables];
    for k in (0..variables).cycle().take(settings.rounds * variables) {
        let tried = penalties.iter().map(|power| {
            let mut powers = powers.clone();
            powers[k] = *power;
            (*power, error(&powers))
        });
        powers[k] = tried.min_by(|a, b| a.1.total_cmp(&b.1))?.0;
    }
    Some(penalty(&powers, rows))
}

/// Squared second differences of neighbouring coefficients. A small multiple of their squares is added: it regularises
/// the directions that the data do not determine, and if the penalty is large it removes slopes as well.
fn penalty(powers: &[i32], rows: usize) -> DMatrix<f64> {
    let rows = rows as f64;
    let mut all = DMatrix::zeros(1 + SPLINES * powers.len(), 1 + SPLINES * powers.len());
    for (k, power) in powers.iter().enumerate() {
        let size = rows * 10.0_f64.powi(*power);
        let first = 1 + SPLINES * k;
        for i in 0..SPLINES {
            all[(first + i, first + i)] += 1e-3 * size + 1e-9 * rows;
        }
        for i in first..first + SPLINES - 2 {
            for (a, wa) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                for (b, wb) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                    all[(i + a, i + b)] += size * wa * wb;
                }
            }
        }
    }
    all
}

fn solve(sums: &Sums, penalty: &DMatrix<f64>) -> Option<Cholesky<f64, nalgebra::Dyn>> {
    (&sums.matrix + penalty).cholesky()
}

fn weights(residuals: &DVector<f64>, huber: f64) -> DVector<f64> {
    let sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    let limit = huber * SIGMA_PER_MAD * upper_median(&sizes);
    residuals.map(|r| (limit / r.abs().max(f64::MIN_POSITIVE)).min(1.0))
}

/// Covariance of the coefficients by leaving out each block in turn: samples of one block need not be
/// independent.
fn jackknife(
    total: &Sums,
    parts: &[Sums],
    penalty: &DMatrix<f64>,
    coefficients: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    let size = coefficients.len();
    let mut covariance = DMatrix::zeros(size, size);
    for part in parts {
        let step = solve(&total.without(part), penalty)?
            .solve(&(&part.right - &part.matrix * coefficients));
        covariance += &step * step.transpose();
    }
    let count = parts.len() as f64;
    Some(covariance * ((count - 1.0) / count))
}
