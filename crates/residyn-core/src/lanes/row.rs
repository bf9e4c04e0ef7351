use std::ops::{Deref, DerefMut};

use super::{Arch, Element, Simd, Vector, WithSimd};

/// `W` numbers side by side, aligned so that whole registers load at full speed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Row<T, const W: usize>(pub [T; W]);

impl<T: Copy, const W: usize> Row<T, W> {
    /// The same number in each lane.
    pub fn splat(value: T) -> Self {
        Self([value; W])
    }

    /// The number of each lane.
    #[inline(always)]
    pub fn from_fn(of_lane: impl FnMut(usize) -> T) -> Self {
        Self(std::array::from_fn(of_lane))
    }

    /// `count` rows of the numbers `of(row, lane)`.
    pub fn table(count: usize, of: impl Fn(usize, usize) -> T) -> Vec<Self> {
        (0..count)
            .map(|row| Self::from_fn(|lane| of(row, lane)))
            .collect()
    }
}

impl<T: Element, const W: usize> Row<T, W> {
    /// Run `work` with the widest vectors that divide a row, or with single numbers if none does.
    pub fn dispatch<F: WithSimd>(work: F) -> F::Output {
        Arch::new().dispatch(Fitting::<T, F, W>(work, std::marker::PhantomData))
    }

    /// Whether a row is a whole number of registers.
    #[inline(always)]
    pub fn fills<S: Simd>() -> bool {
        W.is_multiple_of(T::lanes::<S>())
    }

    /// Number of registers in a row.
    #[inline(always)]
    pub fn parts<S: Simd>() -> usize {
        W / T::lanes::<S>()
    }

    /// The register number `part` of the row.
    #[inline(always)]
    pub fn get<S: Simd>(&self, simd: S, part: usize) -> Vector<S, T> {
        Vector::new(simd, T::registers::<S>(&self.0)[part])
    }

    /// Overwrite the register number `part` of the row.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, part: usize, value: Vector<S, T>) {
        T::registers_mut::<S>(&mut self.0)[part] = value.register;
    }
}

struct Fitting<T, F, const W: usize>(F, std::marker::PhantomData<T>);

impl<T: Element, F: WithSimd, const W: usize> WithSimd for Fitting<T, F, W> {
    type Output = F::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> F::Output {
        if Row::<T, W>::fills::<S>() {
            self.0.with_simd(simd)
        } else {
            self.0.with_simd(pulp::Scalar)
        }
    }
}

impl<T, const W: usize> Deref for Row<T, W> {
    type Target = [T; W];

    #[inline(always)]
    fn deref(&self) -> &[T; W] {
        &self.0
    }
}

impl<T, const W: usize> DerefMut for Row<T, W> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T; W] {
        &mut self.0
    }
}
