use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::normal_equations::{WindowTerms, with_unit_diagonal};
use super::outcome::Fit;
use super::shooting::Shooting;
use crate::data::SAME_S;
use crate::decomposition::eigen;

/// How well a fit determines its free parameters.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// Covariance of the free values, in the order of the fit's columns.
    pub covariance: DMatrix<f64>,
    /// Number of blocks of windows, which are taken as independent.
    pub blocks: usize,
    /// Number of blocks that depend on each column: for a per-log value, the blocks of that log.
    blocks_of: Vec<usize>,
}

/// Length of a block in s: model errors are correlated over a swing or two.
pub const BLOCK_S: f64 = 2.0;
/// Short logs are cut into this many blocks, each at least as long as a window: no test has power with fewer.
const ENOUGH_BLOCKS: f64 = 12.0;
const SHORTEST_BLOCK_S: f64 = 0.5;

/// The block of each window: blocks of a log of about [`BLOCK_S`].
pub fn blocks(shooting: &Shooting<'_>) -> Vec<usize> {
    let windows = &shooting.windows;
    let total_s: f64 = windows.iter().map(|w| w.duration_s(shooting.logs)).sum();
    let length_s = (total_s / ENOUGH_BLOCKS).clamp(SHORTEST_BLOCK_S, BLOCK_S);
    let starts = windows.iter().map(|w| (w.log, w.start_s(shooting.logs)));
    blocks_of_times(starts, length_s)
}

/// How many blocks or groups there are; `groups` gives them by number, from 0.
pub(crate) fn count(groups: &[usize]) -> usize {
    groups.iter().max().map_or(0, |last| last + 1)
}

/// The block of about `length_s` (s) in which each window begins; windows are given as log and start in s.
pub fn blocks_of_times(windows: impl Iterator<Item = (usize, f64)>, length_s: f64) -> Vec<usize> {
    let mut blocks = Vec::new();
    let mut current: Option<(usize, f64)> = None;
    let mut count = 0;
    for (log, start) in windows {
        if current.is_none_or(|(of, since)| of != log || start - since >= length_s - SAME_S) {
            current = Some((log, start));
            count += 1;
        }
        blocks.push(count - 1);
    }
    blocks
}

/// Covariance of the free values by the jackknife over blocks. It holds when residuals are correlated within a block,
/// as they are whenever a model lacks something, and when a few blocks carry most of the information, where the plain
/// sandwich estimator is too small (Bell and McCaffrey 2002). The fits without a block are approximated: each window's
/// loss is taken as quadratic around the joint optimum.
pub fn uncertainty(shooting: &Shooting<'_>, fit: &Fit) -> Uncertainty {
    let blocks = blocks(shooting);
    let size = fit.columns.len();
    let blocks_of = blocks_of(fit, &blocks);
    // Bodies are declared within a spread, whose variance is added below.
    let all = fit.information();
    let mut parts = fit.equations_by(&blocks);
    let count = parts.len();
    let alone: Vec<usize> = (0..size)
        .filter(|&i| blocks_of[i] < 2 && fit.columns[i].log.is_some())
        .collect();
    for part in &mut parts {
        // Without its only block a value is undetermined, so it stays.
        alone.iter().for_each(|&i| part.gradient[i] = 0.0);
    }
    let (model, flat) = inverse(&all);
    let step = |part: &WindowTerms| solution(&(&all - &part.hessian), &part.gradient);
    let steps: Vec<DVector<f64>> = parts.iter().map(step).collect();
    let share = 1.0 / count.max(1) as f64;
    let mean = (steps.iter()).fold(DVector::zeros(size), |sum, step| sum + step) * share;
    let mut spread = flat + &model * &fit.bodies.hessian * &model * excess(fit, &model);
    for step in &steps {
        let off = step - &mean;
        spread += &off * off.transpose() * (1.0 - share);
    }
    // The jackknife gives such a value no variance, so take the inverse of its information.
    for i in alone {
        spread[(i, i)] += model[(i, i)];
    }
    if spread.iter().any(|value| !value.is_finite()) {
        spread = DMatrix::from_diagonal_element(size, size, f64::INFINITY);
    }
    Uncertainty {
        covariance: spread,
        blocks: count,
        blocks_of,
    }
}

/// By how much the variance of bodies about the declared ones exceeds what a fit takes it to be: twice the cost of the
/// departures that the logs determine, over their number (empirical Bayes; MacKay, Bayesian interpolation, 1992), at
/// least 1. Values that the logs do not determine stay at the declared ones and do not show how good those are.
fn excess(fit: &Fit, covariance: &DMatrix<f64>) -> f64 {
    let bodies = &fit.bodies.hessian;
    let of_bodies = (0..bodies.nrows()).filter(|i| bodies[(*i, *i)] > 0.0);
    let message = of_bodies.count() as f64 - (covariance * bodies).trace();
    (2.0 * fit.bodies.cost / message.max(1.0)).max(1.0)
}

/// In how many of the windows' blocks each column enters.
fn blocks_of(fit: &Fit, blocks: &[usize]) -> Vec<usize> {
    let count = |column: usize| {
        let windows = fit.reduced.iter().zip(blocks);
        let mut dependent: Vec<usize> = windows
            .filter(|(window, _)| window.columns.contains(&column))
            .map(|(_, block)| *block)
            .collect();
        dependent.dedup();
        dependent.len()
    };
    (0..fit.columns.len()).map(count).collect()
}

/// Directions with less than this share of the largest eigenvalue are flat: their information is rounding error.
const FLAT: f64 = 1e-9;

/// The values that belong to a gradient, by their information.
fn solution(hessian: &DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
    let (scaled, scale) = with_unit_diagonal(hessian);
    let factor = scaled.cholesky().filter(|factor| {
        let pivots = factor.l_dirty().diagonal();
        pivots.min().powi(2) > FLAT * pivots.max().powi(2)
    });
    match factor {
        Some(factor) => factor
            .solve(&gradient.component_mul(&scale))
            .component_mul(&scale),
        None => inverse(hessian).0 * gradient,
    }
}

/// The inverse of an information matrix, and its part along flat directions. The jackknife, a product of two roundings
/// there, would understate the variance along them.
fn inverse(hessian: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    // With a unit diagonal, "flat" does not depend on units.
    let (scaled, scale) = with_unit_diagonal(hessian);
    let Some(eigen) = eigen(scaled) else {
        // Nothing is known if the equations are not finite.
        let unknown = DMatrix::from_diagonal_element(scale.len(), scale.len(), f64::INFINITY);
        return (unknown.clone(), unknown);
    };
    let values = eigen.eigenvalues.iter().copied();
    let best = values.fold(f64::MIN_POSITIVE, f64::max);
    let back = DMatrix::from_diagonal(&scale) * &eigen.eigenvectors;
    let with = |f: &dyn Fn(f64) -> f64| {
        let weights = eigen.eigenvalues.map(|value| f(value.max(1e-15 * best)));
        &back * DMatrix::from_diagonal(&weights) * back.transpose()
    };
    let flat = |value: f64| match value < FLAT * best {
        true => 1.0 / value,
        false => 0.0,
    };
    (with(&|value| 1.0 / value), with(&flat))
}

impl Uncertainty {
    /// Half width of the 95 % interval of the i-th column: Student's t with one degree of freedom fewer than the blocks
    /// that depend on it.
    pub fn half_width(&self, i: usize) -> f64 {
        self.half_width_of(&[(i, 1.0)])
    }

    /// The same for a sum of columns with these weights.
    pub fn half_width_of(&self, sum: &[(usize, f64)]) -> f64 {
        let part = |(i, weight): &(usize, f64)| -> f64 {
            sum.iter()
                .map(|(j, other)| weight * other * self.covariance[(*i, *j)])
                .sum()
        };
        let variance: f64 = sum.iter().map(part).sum();
        let quantiles = sum.iter().map(|(i, _)| self.student(*i).inverse_cdf(0.975));
        quantiles.fold(0.0, f64::max) * variance.max(0.0).sqrt()
    }

    /// Correlation of the i-th and the j-th column; 0 if one of them is not determined.
    pub fn correlation(&self, i: usize, j: usize) -> f64 {
        let variances = self.covariance[(i, i)] * self.covariance[(j, j)];
        match self.covariance[(i, j)] / variances.sqrt() {
            _ if i == j => 1.0,
            found if found.is_finite() => found,
            _ => 0.0,
        }
    }

    /// Two-sided p-value of the hypothesis that the i-th column is `null`, given `value`.
    pub fn p_value(&self, i: usize, value: f64, null: f64) -> f64 {
        let deviation = self.covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        let distance = ((value - null) / deviation).abs();
        // A value that is NaN says nothing.
        if distance.is_nan() {
            return 1.0;
        }
        2.0 * (1.0 - self.student(i).cdf(distance))
    }

    fn student(&self, i: usize) -> StudentsT {
        let freedom = (self.blocks_of[i] as f64 - 1.0).max(1.0);
        StudentsT::new(0.0, 1.0, freedom).expect("freedom is at least one")
    }
}
