use pulp::Simd;

use super::{Rows, W};
use crate::lanes::{Element, Vector};

/// Applied to a sum before it is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// The sum itself.
    Plain,
    /// max(sum, 0).
    Relu,
    /// The sum where the value that it overwrites is positive, else zero: the derivative of ReLU.
    Masked,
}

/// A matrix times a vector of [`Rows`].
#[derive(Debug, Clone, Copy)]
pub struct Product<'a> {
    /// `[from][to]`
    pub weight: &'a [f32],
    /// `[to]`, or empty for none.
    pub bias: &'a [f32],
    pub finish: Finish,
}

impl Product<'_> {
    #[inline(always)]
    pub fn run<S: Simd>(self, simd: S, from: &[Rows], to: &mut [Rows]) {
        let mut first = 0;
        // The accumulators stay in registers: eight outputs with two registers each if there are 32 registers.
        if S::REGISTER_COUNT >= 32 {
            while to.len() - first >= 8 {
                self.tile::<S, 8>(simd, first, from, to);
                first += 8;
            }
        }
        while to.len() - first >= 4 {
            self.tile::<S, 4>(simd, first, from, to);
            first += 4;
        }
        while to.len() > first {
            self.tile::<S, 1>(simd, first, from, to);
            first += 1;
        }
    }

    /// The outputs `first..first + T`.
    ///
    /// Plain loops on purpose: the compiler may leave `array::from_fn` and `array::map` as calls, and then every
    /// register goes through memory.
    #[inline(always)]
    fn tile<S: Simd, const T: usize>(self, simd: S, first: usize, from: &[Rows], to: &mut [Rows]) {
        for pair in 0..W / (2 * f32::lanes::<S>()) {
            let mut sums = [[Vector::splat(simd, 0.0); 2]; T];
            if let Some(bias) = self.bias.get(first..first + T) {
                for t in 0..T {
                    sums[t] = [Vector::splat(simd, bias[t]); 2];
                }
            }
            for (weights, x) in self.weight.chunks_exact(to.len()).zip(from) {
                let weights = &weights[first..first + T];
                let (left, right) = (x.get(simd, 2 * pair), x.get(simd, 2 * pair + 1));
                for t in 0..T {
                    let weight = Vector::splat(simd, weights[t]);
                    sums[t][0] = left.mul_add(weight, sums[t][0]);
                    sums[t][1] = right.mul_add(weight, sums[t][1]);
                }
            }
            let to = &mut to[first..first + T];
            for t in 0..T {
                for k in 0..2 {
                    let part = 2 * pair + k;
                    let sum = self.finished(sums[t][k], to[t].get(simd, part));
                    to[t].set(part, sum);
                }
            }
        }
    }

    #[inline(always)]
    fn finished<S: Simd>(self, sum: Vector<S, f32>, before: Vector<S, f32>) -> Vector<S, f32> {
        let zero = Vector::splat(sum.simd, 0.0);
        match self.finish {
            Finish::Plain => sum,
            // Comparisons, so that NaN propagates.
            Finish::Relu => sum.if_less(zero, zero, sum),
            Finish::Masked => zero.if_less(before, sum, zero),
        }
    }
}
