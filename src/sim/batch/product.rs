use pulp::Simd;

use super::{Rows, W};
use crate::lanes::{Element, Vector};

/// What becomes of a sum before it is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Finish {
    /// Nothing.
    Plain,
    /// Negative ones become zero.
    Relu,
    /// Zero where the value that it takes the place of is not positive: the derivative of ReLU.
    Masked,
}

/// A matrix times a vector of [`Rows`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Product<'a> {
    /// `[from][to]`
    pub weight: &'a [f32],
    /// `[to]`, or empty for none.
    pub bias: &'a [f32],
    pub finish: Finish,
}

impl Product<'_> {
    #[inline(always)]
    pub(crate) fn run<S: Simd>(self, simd: S, from: &[Rows], to: &mut [Rows]) {
        let mut first = 0;
        // Sums stay in registers: eight outputs of two registers each where there are 32.
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
    #[inline(always)]
    fn tile<S: Simd, const T: usize>(self, simd: S, first: usize, from: &[Rows], to: &mut [Rows]) {
        for pair in 0..W / (2 * f32::lanes::<S>()) {
            let start = |t: usize| match self.bias.get(first + t) {
                Some(bias) => Vector::splat(simd, *bias),
                None => Vector::splat(simd, 0.0),
            };
            let mut sums: [[Vector<S, f32>; 2]; T] = std::array::from_fn(|t| [start(t); 2]);
            for (weights, x) in self.weight.chunks_exact(to.len()).zip(from) {
                let x = f32::registers::<S>(&x.0);
                let x = [2 * pair, 2 * pair + 1].map(|k| Vector::new(simd, x[k]));
                let weights: &[f32; T] = weights[first..]
                    .first_chunk()
                    .expect("a tile lies within the outputs");
                for (sums, weight) in sums.iter_mut().zip(weights) {
                    let weight = Vector::splat(simd, *weight);
                    *sums = [x[0].mul_add(weight, sums[0]), x[1].mul_add(weight, sums[1])];
                }
            }
            for (to, sums) in to[first..first + T].iter_mut().zip(sums) {
                let to = &mut f32::registers_mut::<S>(&mut to.0)[2 * pair..2 * pair + 2];
                for (to, sum) in to.iter_mut().zip(sums) {
                    *to = self.finished(sum, Vector::new(simd, *to)).register;
                }
            }
        }
    }

    #[inline(always)]
    fn finished<S: Simd>(self, sum: Vector<S, f32>, before: Vector<S, f32>) -> Vector<S, f32> {
        let zero = Vector::splat(sum.simd, 0.0);
        match self.finish {
            Finish::Plain => sum,
            // Comparisons, so that what is not a number stays so.
            Finish::Relu => sum.if_less(zero, zero, sum),
            Finish::Masked => zero.if_less(before, sum, zero),
        }
    }
}
