use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use crate::expr::Real;

/// A number type of which a processor holds several in one register.
pub trait Element: Real {
    /// One register.
    type Register<S: Simd>: Copy;
    /// Which lanes a comparison holds in.
    type Mask<S: Simd>: Copy;

    /// How many fit into one register.
    fn lanes<S: Simd>() -> usize;
    /// The numbers as registers.
    ///
    /// # Panics
    /// When they do not fill the last one.
    fn registers<S: Simd>(numbers: &[Self]) -> &[Self::Register<S>];
    /// As [`Element::registers`].
    fn registers_mut<S: Simd>(numbers: &mut [Self]) -> &mut [Self::Register<S>];
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Register<S>;
    fn add<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    fn sub<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    fn mul<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    fn div<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    fn min<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    fn max<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    fn neg<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S>;
    fn abs<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S>;
    fn sqrt<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S>;
    /// a b + c, rounded once where the processor can.
    fn mul_add<S: Simd>(
        simd: S,
        a: Self::Register<S>,
        b: Self::Register<S>,
        c: Self::Register<S>,
    ) -> Self::Register<S>;
    fn less<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Mask<S>;
    fn select<S: Simd>(
        simd: S,
        mask: Self::Mask<S>,
        a: Self::Register<S>,
        b: Self::Register<S>,
    ) -> Self::Register<S>;
    fn sum<S: Simd>(simd: S, a: Self::Register<S>) -> Self;
}

/// One register of numbers, with the operators of numbers.
pub struct Vector<S: Simd, T: Element> {
    pub simd: S,
    pub register: T::Register<S>,
}

impl<S: Simd, T: Element> Copy for Vector<S, T> {}

impl<S: Simd, T: Element> Clone for Vector<S, T> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Simd, T: Element> Vector<S, T> {
    #[inline(always)]
    pub fn new(simd: S, register: T::Register<S>) -> Self {
        Self { simd, register }
    }

    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: T) -> Self {
        Self::new(simd, <T as Element>::splat(simd, value))
    }

    /// A constant beside this vector.
    #[inline(always)]
    pub fn like(self, value: f64) -> Self {
        Self::splat(
            self.simd,
            T::from_f64(value).expect("every f64 has a nearest float"),
        )
    }

    /// self * factor + term
    #[inline(always)]
    pub fn mul_add(self, factor: Self, term: Self) -> Self {
        let register =
            <T as Element>::mul_add(self.simd, self.register, factor.register, term.register);
        Self::new(self.simd, register)
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        Self::new(self.simd, <T as Element>::abs(self.simd, self.register))
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self::new(self.simd, <T as Element>::sqrt(self.simd, self.register))
    }

    /// The smaller; which one of two where one is not a number differs between processors.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self::new(
            self.simd,
            <T as Element>::min(self.simd, self.register, other.register),
        )
    }

    /// The larger; which one of two where one is not a number differs between processors.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self::new(
            self.simd,
            <T as Element>::max(self.simd, self.register, other.register),
        )
    }

    /// `then` where `self < other`, else `otherwise`; what is not a number is less than nothing.
    #[inline(always)]
    pub fn if_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        let mask = <T as Element>::less(self.simd, self.register, other.register);
        let chosen = <T as Element>::select(self.simd, mask, then.register, otherwise.register);
        Self::new(self.simd, chosen)
    }

    /// Sum over the lanes.
    #[inline(always)]
    pub fn sum(self) -> T {
        <T as Element>::sum(self.simd, self.register)
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident) => {
        impl<S: Simd, T: Element> $operator for Vector<S, T> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let register = <T as Element>::$method(self.simd, self.register, other.register);
                Self::new(self.simd, register)
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<S: Simd, T: Element> Neg for Vector<S, T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.simd, <T as Element>::neg(self.simd, self.register))
    }
}

macro_rules! element {
    ($number:ty, $register:ident, $mask:ident, $lanes:ident, $read:ident, $write:ident, $sum:ident, $select:ident,
     $splat:ident, $mul_add:ident, $less:ident, {$($unary:ident: $unary_of:ident),*}, {$($binary:ident: $of:ident),*}) => {
        impl Element for $number {
            type Register<S: Simd> = S::$register;
            type Mask<S: Simd> = S::$mask;

            #[inline(always)]
            fn lanes<S: Simd>() -> usize {
                S::$lanes
            }

            #[inline(always)]
            fn registers<S: Simd>(numbers: &[Self]) -> &[S::$register] {
                let (registers, rest) = S::$read(numbers);
                assert!(rest.is_empty(), "the numbers fill whole registers");
                registers
            }

            #[inline(always)]
            fn registers_mut<S: Simd>(numbers: &mut [Self]) -> &mut [S::$register] {
                let (registers, rest) = S::$write(numbers);
                assert!(rest.is_empty(), "the numbers fill whole registers");
                registers
            }

            #[inline(always)]
            fn splat<S: Simd>(simd: S, value: Self) -> S::$register {
                simd.$splat(value)
            }

            $(#[inline(always)]
            fn $unary<S: Simd>(simd: S, a: S::$register) -> S::$register {
                simd.$unary_of(a)
            })*

            $(#[inline(always)]
            fn $binary<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$register {
                simd.$of(a, b)
            })*

            #[inline(always)]
            fn mul_add<S: Simd>(
                simd: S,
                a: S::$register,
                b: S::$register,
                c: S::$register,
            ) -> S::$register {
                simd.$mul_add(a, b, c)
            }

            #[inline(always)]
            fn less<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$mask {
                simd.$less(a, b)
            }

            #[inline(always)]
            fn select<S: Simd>(
                simd: S,
                mask: S::$mask,
                a: S::$register,
                b: S::$register,
            ) -> S::$register {
                simd.$select(mask, a, b)
            }

            #[inline(always)]
            fn sum<S: Simd>(simd: S, a: S::$register) -> Self {
                simd.$sum(a)
            }
        }
    };
}

element!(f32, f32s, m32s, F32_LANES, as_simd_f32s, as_mut_simd_f32s, reduce_sum_f32s, select_f32s,
    splat_f32s, mul_add_e_f32s, less_than_f32s, {neg: neg_f32s, abs: abs_f32s, sqrt: sqrt_f32s},
    {add: add_f32s, sub: sub_f32s, mul: mul_f32s, div: div_f32s, min: min_f32s, max: max_f32s});
element!(f64, f64s, m64s, F64_LANES, as_simd_f64s, as_mut_simd_f64s, reduce_sum_f64s, select_f64s,
    splat_f64s, mul_add_e_f64s, less_than_f64s, {neg: neg_f64s, abs: abs_f64s, sqrt: sqrt_f64s},
    {add: add_f64s, sub: sub_f64s, mul: mul_f64s, div: div_f64s, min: min_f64s, max: max_f64s});
