use std::f32::consts::TAU;

use rand::{Rng, RngExt};

use residyn_core::lanes::{Arch, Element, Simd, Vector, WithSimd};
use residyn_core::sim::batch::{Rows, W};

/// Resolution of uniform numbers from 24 random bits, all of them exact in f32.
const UNIT: f32 = 1.0 / (1 << 24) as f32;

/// Standard normal numbers by the method of Box and Muller (1958): two rows from two rows of uniform numbers. With 24
/// bits no number exceeds 5.8 standard deviations.
#[derive(Debug, Clone)]
pub struct Gaussian {
    bits: Vec<u32>,
}

impl Gaussian {
    /// A buffer for this many rows.
    pub fn new(rows: usize) -> Self {
        Self {
            bits: vec![0; 2 * rows.div_ceil(2) * W],
        }
    }

    /// Fill `rows`, drawing from `rng` in order.
    pub fn fill(&mut self, arch: Arch, rng: &mut impl Rng, rows: &mut [Rows]) {
        rng.fill(&mut self.bits[..]);
        arch.dispatch(Transform {
            bits: &self.bits,
            rows,
        });
    }
}

struct Transform<'a> {
    bits: &'a [u32],
    rows: &'a mut [Rows],
}

impl WithSimd for Transform<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (pair, bits) in self.rows.chunks_mut(2).zip(self.bits.chunks_exact(2 * W)) {
            let (mut share, mut angle) = (Rows::splat(0.0), Rows::splat(0.0));
            for lane in 0..W {
                // Never zero, since its logarithm is taken.
                share[lane] = ((bits[lane] >> 8) + 1) as f32 * UNIT;
                angle[lane] = (bits[W + lane] >> 8) as f32 * (TAU * UNIT);
            }
            let (first, second) = pair.split_at_mut(1);
            let registers = f32::registers_mut::<S>(&mut *share).iter_mut();
            for (share, angle) in registers.zip(f32::registers_mut::<S>(&mut *angle)) {
                let log = Vector::<S, f32>::new(simd, *share).ln();
                let radius = (log * log.like(-2.0)).sqrt();
                let (sine, cosine) = Vector::<S, f32>::new(simd, *angle).sin_cos();
                *share = (radius * cosine).register;
                *angle = (radius * sine).register;
            }
            first[0] = share;
            if let [second] = second {
                *second = angle;
            }
        }
    }
}
