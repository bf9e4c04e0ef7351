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

/// Running sums of the normal equations of all lanes. The matrix is stored as its upper triangle.
pub(super) struct Sums {
    columns: usize,
    cost: Lane,
    gradient: Vec<Lane>,
    triangle: Vec<Lane>,
}

impl Sums {
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            cost: Row::splat(0.0),
            gradient: vec![Row::splat(0.0); columns],
            triangle: vec![Row::splat(0.0); columns * (columns + 1) / 2],
        }
    }

    /// Add one measurement: its normalised residual, the sensitivities of the angle, and 1 / (noise scale).
    pub fn add(&mut self, residual: &Lane, sensitivities: &[Lane], weight: &Lane) {
        let losses = residual.map(loss);
        for lane in 0..LANES {
            self.cost[lane] += losses[lane].0;
        }
        Lane::dispatch(Add {
            sums: self,
            // Both are multiplied by the weight of Huber's loss.
            residual: Row(std::array::from_fn(|l| {
                losses[l].1 * weight[l] * residual[l]
            })),
            weight: Row(std::array::from_fn(|l| losses[l].1 * weight[l] * weight[l])),
            sensitivities,
        });
    }

    pub fn lane(&self, lane: usize) -> WindowTerms {
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

struct Add<'a> {
    sums: &'a mut Sums,
    residual: Lane,
    weight: Lane,
    sensitivities: &'a [Lane],
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Sums {
            gradient, triangle, ..
        } = self.sums;
        for part in 0..Lane::parts::<S>() {
            let (residual, weight) = (self.residual.get(simd, part), self.weight.get(simd, part));
            let mut entries = triangle.as_mut_slice();
            for (i, sum) in gradient.iter_mut().enumerate() {
                let rest = &self.sensitivities[i..];
                let a = rest[0].get(simd, part);
                sum.set(part, a.mul_add(residual, sum.get(simd, part)));
                let scaled = a * weight;
                let (own, others) = entries.split_at_mut(rest.len());
                for (b, entry) in rest.iter().zip(own) {
                    let b = b.get(simd, part);
                    entry.set(part, b.mul_add(scaled, entry.get(simd, part)));
                }
                entries = others;
            }
        }
    }
}
