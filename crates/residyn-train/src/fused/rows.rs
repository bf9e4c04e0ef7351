//! Arithmetic on blocks of rows, register by register.

use pulp::Simd;

use residyn_core::lanes::{Element, Vector};
use residyn_core::sim::batch::Rows;

/// Replaces `to` by `value(to, of)`, lane by lane.
#[inline(always)]
pub(super) fn update<S: Simd, const N: usize>(
    simd: S,
    to: &mut Rows,
    of: [&Rows; N],
    value: impl Fn(Vector<S, f32>, [Vector<S, f32>; N]) -> Vector<S, f32>,
) {
    let to = f32::registers_mut::<S>(&mut to.0);
    for (k, to) in to.iter_mut().enumerate() {
        let mut operands = [Vector::splat(simd, 0.0); N];
        for n in 0..N {
            operands[n] = of[n].get(simd, k);
        }
        *to = value(Vector::new(simd, *to), operands).register;
    }
}

/// The sum over all lanes.
#[inline(always)]
pub(super) fn total<S: Simd>(simd: S, rows: &Rows) -> f64 {
    let mut total = 0.0;
    for register in f32::registers::<S>(&rows.0) {
        total += f64::from(Vector::<S, f32>::new(simd, *register).sum());
    }
    total
}
