use nalgebra::{Cholesky, DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::force::ForceSample;
use crate::data::statistics::{SIGMA_PER_MAD, quantile, upper_median};
use crate::identify::{BLOCK_S, stretches};

/// The residual force of a joint as a smooth curve over one variable, the others' shares taken off.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Counted from 1.
    pub joint: usize,
    /// `q1`, `qd1`, `tau1` or `t`.
    pub variable: String,
    /// Of the variable.
    pub unit: &'static str,
    pub x: Vec<f64>,
    /// In N m (or N).
    pub force: Vec<f64>,
    /// Ends of the pointwise 95 % band.
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

/// A variable that a force may follow.
struct Variable {
    name: &'static str,
    /// On a turning joint and on a sliding one.
    units: [&'static str; 2],
    value: fn(&ForceSample, usize) -> f64,
}

const VARIABLES: [Variable; 4] = [
    Variable {
        name: "q",
        units: ["rad", "m"],
        value: |sample, joint| sample.q[joint],
    },
    Variable {
        name: "qd",
        units: ["rad/s", "m/s"],
        value: |sample, joint| sample.qd[joint],
    },
    Variable {
        name: "tau",
        units: ["N m", "N"],
        value: |sample, joint| sample.tau[joint],
    },
    Variable {
        name: "t",
        units: ["s", "s"],
        value: |sample, _| sample.time_s,
    },
];

/// Points of a curve.
const POINTS: usize = 40;
/// Splines along a variable: cubic, on knots at equal distances (Eilers and Marx 1996).
const SPLINES: usize = 14;
/// A curve covers the middle 98 % of a variable's values.
const QUANTILES: [f64; 2] = [0.01, 0.99];
/// Fewer stretches of [`BLOCK_S`] than this give no band.
const FEWEST_STRETCHES: usize = 5;
/// Parts that the stretches are left out in when the smoothness is chosen.
const PARTS: usize = 8;
/// Smoothness that is tried: the penalty per sample, as powers of ten.
const PENALTIES: [i32; 9] = [-6, -5, -4, -3, -2, -1, 0, 1, 2];
/// Rounds over the variables; the choice settles in two.
const ROUNDS: usize = 2;
/// Forces farther from the curves than this many scales weigh less (Huber 1964).
const HUBER: f64 = 3.0;

/// One curve for each joint and each variable that takes more than one value; none for logs too short to give
/// a band. The curves of a joint are fitted together, so that none borrows the shape of another.
pub(super) fn curves(samples: &[ForceSample], prismatic: &[bool]) -> Vec<Curve> {
    let blocks = stretches(samples.iter().map(|s| (s.log, s.time_s)), BLOCK_S);
    if blocks.last().is_none_or(|last| last + 1 < FEWEST_STRETCHES) {
        return Vec::new();
    }
    let joints = 0..prismatic.len();
    joints
        .flat_map(|joint| of_joint(samples, &blocks, joint, prismatic[joint]))
        .collect()
}

fn of_joint(
    samples: &[ForceSample],
    blocks: &[usize],
    joint: usize,
    prismatic: bool,
) -> Vec<Curve> {
    let bases: Vec<(&Variable, Basis)> = VARIABLES
        .iter()
        .filter_map(|variable| {
            let values = samples.iter().map(|sample| (variable.value)(sample, joint));
            Some((variable, Basis::over(values.collect())?))
        })
        .collect();
    let forces = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.force[joint]));
    let shapes: Vec<&Basis> = bases.iter().map(|(_, basis)| basis).collect();
    let Some(fit) = Additive::fit(&shapes, &forces, blocks) else {
        return Vec::new();
    };
    bases
        .iter()
        .enumerate()
        .map(|(k, (variable, basis))| {
            let numbered = match variable.name {
                "t" => "t".to_owned(),
                name => format!("{name}{}", joint + 1),
            };
            fit.curve(
                k,
                basis,
                joint + 1,
                numbered,
                variable.units[usize::from(prismatic)],
            )
        })
        .collect()
}

/// Cubic splines over one variable, as functions whose mean over the samples is zero.
struct Basis {
    low: f64,
    high: f64,
    /// `[sample, spline]`, centred.
    columns: DMatrix<f64>,
    /// What was taken off to centre them.
    means: Vec<f64>,
}

impl Basis {
    /// `None` where the values do not differ.
    fn over(values: Vec<f64>) -> Option<Self> {
        let [low, high] = QUANTILES.map(|share| quantile(&values, share));
        if !(high - low > 1e-9 * (1.0 + high.abs().max(low.abs()))) {
            return None;
        }
        let mut columns = DMatrix::zeros(values.len(), SPLINES);
        for (row, value) in values.iter().enumerate() {
            columns
                .row_mut(row)
                .copy_from_slice(&splines((value - low) / (high - low)));
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

    /// The centred splines at a value.
    fn at(&self, value: f64) -> impl Iterator<Item = f64> {
        let splines = splines((value - self.low) / (self.high - self.low));
        splines
            .into_iter()
            .zip(&self.means)
            .map(|(b, mean)| b - mean)
    }
}

/// The cubic splines at a place from 0 to 1, constant beyond.
fn splines(place: f64) -> [f64; SPLINES] {
    #[allow(clippy::cast_precision_loss)] // few splines
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
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small whole number
    for (spline, part) in all[piece as usize..].iter_mut().zip(parts) {
        *spline = part / 6.0;
    }
    all
}

/// An intercept and a smooth share of each variable, fitted together by penalised least squares.
struct Additive {
    coefficients: DVector<f64>,
    covariance: DMatrix<f64>,
    /// 97.5 % quantile of Student's t with one degree of freedom a stretch less one.
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
    fn fit(bases: &[&Basis], forces: &DVector<f64>, blocks: &[usize]) -> Option<Self> {
        let rows = forces.len();
        let mut design = DMatrix::from_element(rows, 1 + SPLINES * bases.len(), 1.0);
        for (k, basis) in bases.iter().enumerate() {
            design
                .columns_mut(1 + SPLINES * k, SPLINES)
                .copy_from(&basis.columns);
        }
        let even = DVector::from_element(rows, 1.0);
        let first = Sums::by_block(&design, forces, &even, blocks);
        let penalties = smoothness(&first, bases.len(), rows)?;
        let rough = solve(&Sums::total(&first), &penalties)?.solve(&Sums::total(&first).right);
        let weights = weights(&(forces - &design * rough));
        let parts = Sums::by_block(&design, forces, &weights, blocks);
        let penalties = smoothness(&parts, bases.len(), rows)?;
        let total = Sums::total(&parts);
        let coefficients = solve(&total, &penalties)?.solve(&total.right);
        let covariance = jackknife(&total, &parts, &penalties, &coefficients)?;
        #[allow(clippy::cast_precision_loss)] // few stretches
        let freedom = parts.len() as f64 - 1.0;
        let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
        Some(Self {
            coefficients,
            covariance,
            quantile: student.inverse_cdf(0.975),
        })
    }

    fn curve(
        &self,
        k: usize,
        basis: &Basis,
        joint: usize,
        variable: String,
        unit: &'static str,
    ) -> Curve {
        let mut curve = Curve {
            joint,
            variable,
            unit,
            x: Vec::new(),
            force: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
        };
        for point in 0..POINTS {
            #[allow(clippy::cast_precision_loss)] // few points
            let place = point as f64 / (POINTS - 1) as f64;
            let x = basis.low + place * (basis.high - basis.low);
            let mut row = DVector::zeros(self.coefficients.len());
            row[0] = 1.0;
            for (slot, value) in row.iter_mut().skip(1 + SPLINES * k).zip(basis.at(x)) {
                *slot = value;
            }
            let force = row.dot(&self.coefficients);
            let variance = row.dot(&(&self.covariance * &row));
            let half = self.quantile * variance.max(0.0).sqrt();
            curve.x.push(x);
            curve.force.push(force);
            curve.low.push(force - half);
            curve.high.push(force + half);
        }
        curve
    }
}

impl Sums {
    fn by_block(
        design: &DMatrix<f64>,
        forces: &DVector<f64>,
        weights: &DVector<f64>,
        blocks: &[usize],
    ) -> Vec<Self> {
        let count = blocks.last().map_or(0, |last| last + 1);
        let rows_of = |block: usize| {
            let first = blocks.partition_point(|b| *b < block);
            (first, blocks.partition_point(|b| *b <= block) - first)
        };
        (0..count)
            .map(|block| {
                let (first, rows) = rows_of(block);
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

/// The penalty of each variable that predicts stretches best that it was not fitted to, tried one after the other.
fn smoothness(parts: &[Sums], variables: usize, rows: usize) -> Option<DMatrix<f64>> {
    let left_out: Vec<Sums> = (0..PARTS.min(parts.len()))
        .map(|fold| {
            let members: Vec<Sums> = parts.iter().skip(fold).step_by(PARTS).cloned().collect();
            Sums::total(&members)
        })
        .collect();
    let total = Sums::total(parts);
    let rests: Vec<Sums> = left_out.iter().map(|part| total.without(part)).collect();
    let error = |powers: &[i32]| -> f64 {
        let penalty = penalty(powers, rows);
        let fitted = rests.iter().map(|rest| solve(rest, &penalty));
        fitted
            .zip(&rests)
            .zip(&left_out)
            .map(|((solver, rest), part)| match solver {
                Some(solver) => part.error(&solver.solve(&rest.right)),
                None => f64::INFINITY,
            })
            .sum()
    };
    let mut powers = vec![PENALTIES[PENALTIES.len() / 2]; variables];
    for k in (0..variables).cycle().take(ROUNDS * variables) {
        let tried = PENALTIES.iter().map(|power| {
            let mut powers = powers.clone();
            powers[k] = *power;
            (*power, error(&powers))
        });
        powers[k] = tried.min_by(|a, b| a.1.total_cmp(&b.1))?.0;
    }
    Some(penalty(&powers, rows))
}

/// Squared second differences of neighbouring coefficients. A trace of their squares is added: it holds what the
/// data leave open, and where the penalty is large it takes away slopes as well.
fn penalty(powers: &[i32], rows: usize) -> DMatrix<f64> {
    #[allow(clippy::cast_precision_loss)] // few samples
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

fn weights(residuals: &DVector<f64>) -> DVector<f64> {
    let sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    let limit = HUBER * SIGMA_PER_MAD * upper_median(&sizes);
    residuals.map(|r| (limit / r.abs().max(f64::MIN_POSITIVE)).min(1.0))
}

/// Covariance of the coefficients by leaving out each stretch in turn: samples of one stretch need not be
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
    #[allow(clippy::cast_precision_loss)] // few stretches
    let count = parts.len() as f64;
    Some(covariance * ((count - 1.0) / count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Noise of neighbouring stretches has something in common.
    fn samples(force: fn(f64, f64) -> f64, noise: f64, rng: &mut impl Rng) -> Vec<ForceSample> {
        let mut carried = 0.0;
        (0..400)
            .map(|i| {
                let t = 0.15 * f64::from(i);
                let fresh: f64 = StandardNormal.sample(rng);
                carried = 0.5 * carried + fresh;
                let (q, qd) = (
                    rng.random_range(-1.5..1.5),
                    (2.0 * t).sin() * rng.random_range(0.0..6.0),
                );
                ForceSample {
                    log: i as usize / 100,
                    time_s: t,
                    q: vec![q],
                    qd: vec![qd],
                    tau: vec![0.0],
                    force: vec![force(q, qd) + noise * carried],
                }
            })
            .collect()
    }

    #[test]
    fn splines_add_up_to_one() {
        for place in [0.0, 0.123, 0.5, 0.999, 1.0, 2.0] {
            assert!((splines(place).iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_variable_that_does_not_vary_has_no_curve() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let found = curves(&samples(|q, _| q, 0.1, &mut rng), &[false]);
        let names: Vec<&str> = found.iter().map(|c| c.variable.as_str()).collect();
        assert_eq!(names, ["q1", "qd1", "t"]);
        assert!(found.iter().all(|c| c.x.len() == POINTS));
    }

    #[test]
    fn the_band_holds_the_force_and_no_variable_borrows_it() {
        let force = |_: f64, qd: f64| -0.002 * qd.powi(3) + 0.05 * (1.3 * qd).sin();
        let (mut held, mut all, mut off) = (0, 0, 0.0_f64);
        for seed in 0..30 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let samples = samples(force, 0.05, &mut rng);
            let mean = samples.iter().map(|s| force(0.0, s.qd[0])).sum::<f64>() / 400.0;
            for curve in curves(&samples, &[false]) {
                for (i, &x) in curve.x.iter().enumerate() {
                    let truth = if curve.variable == "qd1" {
                        force(0.0, x)
                    } else {
                        mean
                    };
                    let holds = curve.low[i] <= truth && truth <= curve.high[i];
                    (held, all) = (held + usize::from(holds), all + 1);
                    if curve.variable == "q1" {
                        off = off.max((curve.force[i] - mean).abs());
                    }
                }
            }
        }
        let share = held as f64 / all as f64;
        println!("{share} {off}");
        assert!((0.85..0.995).contains(&share), "{share}");
        // The force itself is up to 0.45 N m.
        assert!(off < 0.1, "{off}");
    }
}
