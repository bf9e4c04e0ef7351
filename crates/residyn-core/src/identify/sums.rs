//! Normal equations summed row by row, over windows that are integrated side by side.

use nalgebra::{DMatrix, DVector};

use super::normal_equations::WindowTerms;
use super::sensitivity::{LANES, Lane};
use crate::lanes::{Row, Simd, WithSimd};

/// Residuals larger than this many scales enter the loss linearly instead of quadratically (Huber 1964). Outliers
/// lose their influence, while only 0.3 % of a normal sample are affected.
const HUBER: f64 = 3.0;

/// Huber's loss, and the weight with which iteratively reweighted least squares has the same gradient.
pub(super) fn loss(residual: f64) -> (f64, f64) {
    let size = residual.abs();
    if size <= HUBER {
        (0.5 * residual * residual, 1.0)
    } else {
        (HUBER * (size - 0.5 * HUBER), HUBER / size)
    }
}

/// Huber's loss of a residual in units of its scale.
pub fn huber(residual: f64) -> f64 {
    loss(residual).0
}

/// Measurements that are added at once: the sums exceed the processor's first-level cache, and are fetched once for all
/// of these measurements.
const TOGETHER: usize = 8;

/// Running sums of the normal equations of all lanes. The matrix is stored as its upper triangle.
pub(super) struct Sums {
    columns: usize,
    cost: Lane,
    gradient: Vec<Lane>,
    triangle: Vec<Lane>,
    waiting: Waiting,
}

/// Measurements that are not in the sums yet.
struct Waiting {
    count: usize,
    /// Both multiplied by the weight of Huber's loss.
    residuals: [Lane; TOGETHER],
    weights: [Lane; TOGETHER],
    /// `[column][measurement]`
    sensitivities: Vec<[Lane; TOGETHER]>,
}

impl Waiting {
    fn new(columns: usize) -> Self {
        let none = [Row::splat(0.0); TOGETHER];
        Self {
            count: 0,
            residuals: none,
            weights: none,
            sensitivities: vec![none; columns],
        }
    }
}

impl Sums {
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            cost: Row::splat(0.0),
            gradient: vec![Row::splat(0.0); columns],
            triangle: vec![Row::splat(0.0); columns * (columns + 1) / 2],
            waiting: Waiting::new(columns),
        }
    }

    /// Add one measurement: its normalised residual, its sensitivities column by column, and 1 / (noise scale).
    pub fn add<'a>(
        &mut self,
        residual: &Lane,
        sensitivities: impl IntoIterator<Item = &'a Lane>,
        weight: &Lane,
    ) {
        let losses = residual.map(loss);
        for lane in 0..LANES {
            self.cost[lane] += losses[lane].0;
        }
        let waiting = &mut self.waiting;
        let at = waiting.count;
        waiting.residuals[at] = Row::from_fn(|l| losses[l].1 * weight[l] * residual[l]);
        waiting.weights[at] = Row::from_fn(|l| losses[l].1 * weight[l] * weight[l]);
        for (column, value) in waiting.sensitivities.iter_mut().zip(sensitivities) {
            column[at] = *value;
        }
        waiting.count += 1;
        if waiting.count == TOGETHER {
            self.add_waiting();
        }
    }

    fn add_waiting(&mut self) {
        let waiting = &mut self.waiting;
        // Unfilled places hold a measurement that has already been added.
        for at in waiting.count..TOGETHER {
            waiting.residuals[at] = Row::splat(0.0);
            waiting.weights[at] = Row::splat(0.0);
        }
        waiting.count = 0;
        Lane::dispatch(AddWaiting(self));
    }

    /// The normal equations of the first `count` lanes.
    pub fn lanes(mut self, count: usize) -> Vec<WindowTerms> {
        self.add_waiting();
        (0..count).map(|lane| self.lane(lane)).collect()
    }

    fn lane(&self, lane: usize) -> WindowTerms {
        let mut hessian = DMatrix::zeros(self.columns, self.columns);
        let mut entries = self.triangle.iter();
        for i in 0..self.columns {
            for j in i..self.columns {
                let value = entries.next().expect("the triangle has this entry")[lane];
                hessian[(i, j)] = value;
                hessian[(j, i)] = value;
            }
        }
        WindowTerms {
            cost: self.cost[lane],
            gradient: DVector::from_iterator(self.columns, self.gradient.iter().map(|g| g[lane])),
            hessian,
        }
    }
}

struct AddWaiting<'a>(&'a mut Sums);

impl WithSimd for AddWaiting<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Sums {
            gradient,
            triangle,
            waiting,
            ..
        } = self.0;
        for part in 0..Lane::parts::<S>() {
            let mut entries = triangle.as_mut_slice();
            for (i, gradient) in gradient.iter_mut().enumerate() {
                let rest = &waiting.sensitivities[i..];
                let mut scaled = rest[0].map(|value| value.get(simd, part));
                let mut sum = gradient.get(simd, part);
                for (k, value) in scaled.iter_mut().enumerate() {
                    sum = value.mul_add(waiting.residuals[k].get(simd, part), sum);
                    *value = *value * waiting.weights[k].get(simd, part);
                }
                gradient.set(part, sum);
                let (own, others) = entries.split_at_mut(rest.len());
                for (values, entry) in rest.iter().zip(own) {
                    let mut sum = entry.get(simd, part);
                    for (value, scaled) in values.iter().zip(&scaled) {
                        sum = value.get(simd, part).mul_add(*scaled, sum);
                    }
                    entry.set(part, sum);
                }
                entries = others;
            }
        }
    }
}
