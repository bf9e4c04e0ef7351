use std::ops::{Deref, DerefMut};

/// `W` numbers side by side, at an address from which a processor reads whole registers at full speed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Row<T, const W: usize>(pub [T; W]);

impl<T: Copy, const W: usize> Row<T, W> {
    /// The same number in each lane.
    pub fn splat(value: T) -> Self {
        Self([value; W])
    }
}

impl<T, const W: usize> From<[T; W]> for Row<T, W> {
    fn from(values: [T; W]) -> Self {
        Self(values)
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
