use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use super::math::Constants;

/// A number type with vector registers: f64 for identification, f32 for training and planning.
pub trait Element:
    num_traits::Float + num_traits::FromPrimitive + Default + Send + Sync + Constants
{
    /// One register.
    type Register<S: Simd>: Copy;
    /// The lanes in which a comparison is true.
    type Mask<S: Simd>: Copy;

    /// Numbers in one register.
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
    /// a b + c, rounded once if the processor has a fused multiply-add.
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
    fn equal<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Mask<S>;
    /// Whether a comparison is true in any lane.
    fn any<S: Simd>(simd: S, mask: Self::Mask<S>) -> bool;
    /// Whether a bit of the representation is set; bit 0 is the lowest.
    fn bit<S: Simd>(simd: S, a: Self::Register<S>, bit: u32) -> Self::Mask<S>;
    /// The magnitude of `a` with the sign of `sign`.
    fn with_sign_of<S: Simd>(
        simd: S,
        a: Self::Register<S>,
        sign: Self::Register<S>,
    ) -> Self::Register<S>;
    /// 2^k for integers k if that is a normal number.
    fn power_of_two<S: Simd>(simd: S, k: Self::Register<S>) -> Self::Register<S>;
    /// The numbers of one register.
    fn numbers<S: Simd>(register: &mut Self::Register<S>) -> &mut [Self];
}

/// One register of numbers with arithmetic operators.
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

    /// A constant in every lane, of the same type as this vector.
    #[inline(always)]
    pub fn like(self, value: f64) -> Self {
        Self::splat(
            self.simd,
            T::from_f64(value).expect("every f64 has a nearest float"),
        )
    }

    /// `then` where `self < other`, else `otherwise`; false for a NaN.
    #[inline(always)]
    pub fn if_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        let mask = <T as Element>::less(self.simd, self.register, other.register);
        then.where_in(mask, otherwise)
    }

    /// `then` where `self == other`, else `otherwise`; false for a NaN.
    #[inline(always)]
    pub fn if_equal(self, other: Self, then: Self, otherwise: Self) -> Self {
        let mask = <T as Element>::equal(self.simd, self.register, other.register);
        then.where_in(mask, otherwise)
    }

    /// `self` in the lanes of a mask, else `otherwise`.
    #[inline(always)]
    pub(super) fn where_in(self, mask: T::Mask<S>, otherwise: Self) -> Self {
        let chosen = <T as Element>::select(self.simd, mask, self.register, otherwise.register);
        Self::new(self.simd, chosen)
    }

    /// Whether `self < other` in any lane.
    #[inline(always)]
    pub fn any_less(self, other: Self) -> bool {
        let mask = <T as Element>::less(self.simd, self.register, other.register);
        <T as Element>::any(self.simd, mask)
    }

    /// Apply a scalar function to each lane.
    #[inline(always)]
    pub fn each(mut self, function: impl Fn(T) -> T) -> Self {
        for number in T::numbers::<S>(&mut self.register) {
            *number = function(*number);
        }
        self
    }

    /// Apply a scalar function of two numbers to each lane.
    #[inline(always)]
    pub fn each_with(mut self, mut other: Self, function: impl Fn(T, T) -> T) -> Self {
        let others = T::numbers::<S>(&mut other.register);
        for (number, other) in T::numbers::<S>(&mut self.register).iter_mut().zip(others) {
            *number = function(*number, *other);
        }
        self
    }

    /// The sum of all lanes.
    #[inline(always)]
    pub fn sum(self) -> T {
        <T as Element>::sum(self.simd, self.register)
    }
}

macro_rules! methods {
    ($($(#[$doc:meta])* $method:ident($($other:ident),*);)*) => {
        impl<S: Simd, T: Element> Vector<S, T> {$(
            $(#[$doc])*
            #[inline(always)]
            pub fn $method(self, $($other: Self),*) -> Self {
                let register = <T as Element>::$method(self.simd, self.register, $($other.register),*);
                Self::new(self.simd, register)
            }
        )*}
    };
}

methods! {
    abs();
    sqrt();
    /// 2^k for integers k if that is a normal number.
    power_of_two();
    /// self * factor + term
    mul_add(factor, term);
    /// The minimum; with a NaN the result depends on the processor.
    min(other);
    /// The maximum; with a NaN the result depends on the processor.
    max(other);
    /// The magnitude of `self` with the sign of `sign`.
    with_sign_of(sign);
}

macro_rules! operators {
    ($($operator:ident: $method:ident($($other:ident),*);)*) => {$(
        impl<S: Simd, T: Element> $operator for Vector<S, T> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, $($other: Self),*) -> Self {
                let register = <T as Element>::$method(self.simd, self.register, $($other.register),*);
                Self::new(self.simd, register)
            }
        }
    )*};
}

operators! {
    Add: add(other);
    Sub: sub(other);
    Mul: mul(other);
    Div: div(other);
    Neg: neg();
}

macro_rules! element {
    ($number:ty, $register:ident, $mask:ident, $lanes:ident, $read:ident, $write:ident, $sum:ident, $select:ident,
     $splat:ident, {$($method:ident($($operand:ident),*): $of:ident),*}, {$($comparison:ident: $comparison_of:ident),*}, $first:ident, {$bits:ident, $to_bits:ident, $of_bits:ident, $splat_bits:ident, $same_bits:ident, $and:ident, $shift:ident},
     {$and_not:ident, $and_number:ident, $or_number:ident}) => {
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
            fn $method<S: Simd>(simd: S, $($operand: S::$register),*) -> S::$register {
                simd.$of($($operand),*)
            })*

            $(#[inline(always)]
            fn $comparison<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$mask {
                simd.$comparison_of(a, b)
            })*

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

            #[inline(always)]
            fn any<S: Simd>(simd: S, mask: S::$mask) -> bool {
                simd.$first(mask) < S::$lanes
            }

            #[inline(always)]
            fn bit<S: Simd>(simd: S, a: S::$register, bit: u32) -> S::$mask {
                let bit = simd.$splat_bits(1 << bit);
                simd.$same_bits(simd.$and(simd.$to_bits(a), bit), bit)
            }

            #[inline(always)]
            fn with_sign_of<S: Simd>(
                simd: S,
                a: S::$register,
                sign: S::$register,
            ) -> S::$register {
                let sign_bit = simd.$splat(-0.0);
                simd.$or_number(
                    simd.$and_number(simd.$and_not(sign_bit), a),
                    simd.$and_number(sign_bit, sign),
                )
            }

            #[inline(always)]
            fn power_of_two<S: Simd>(simd: S, k: S::$register) -> S::$register {
                // Adding LOWEST puts the biased exponent into the lowest bits; an integer multiplication moves it to
                // the exponent field and all other bits out.
                const PLACE: u32 = <$number>::MANTISSA_DIGITS - 1;
                const LOWEST: $number = 1.0 / <$number>::EPSILON + (<$number>::MAX_EXP - 1) as $number;
                let biased = simd.$to_bits(<Self as Element>::add(simd, k, simd.$splat(LOWEST)));
                simd.$of_bits(simd.$shift(biased, simd.$splat_bits(1 << PLACE)))
            }

            #[inline(always)]
            fn numbers<S: Simd>(register: &mut S::$register) -> &mut [Self] {
                pulp::bytemuck::cast_slice_mut(std::slice::from_mut(register))
            }
        }
    };
}

element!(f32, f32s, m32s, F32_LANES, as_simd_f32s, as_mut_simd_f32s, reduce_sum_f32s, select_f32s,
    splat_f32s, {neg(a): neg_f32s, abs(a): abs_f32s, sqrt(a): sqrt_f32s, add(a, b): add_f32s, sub(a, b): sub_f32s,
    mul(a, b): mul_f32s, div(a, b): div_f32s, min(a, b): min_f32s, max(a, b): max_f32s, mul_add(a, b, c): mul_add_e_f32s},
    {less: less_than_f32s, equal: equal_f32s}, first_true_m32s, {u32, transmute_u32s_f32s, transmute_f32s_u32s, splat_u32s, equal_u32s, and_u32s, mul_u32s},
    {not_f32s, and_f32s, or_f32s});
element!(f64, f64s, m64s, F64_LANES, as_simd_f64s, as_mut_simd_f64s, reduce_sum_f64s, select_f64s,
    splat_f64s, {neg(a): neg_f64s, abs(a): abs_f64s, sqrt(a): sqrt_f64s, add(a, b): add_f64s, sub(a, b): sub_f64s,
    mul(a, b): mul_f64s, div(a, b): div_f64s, min(a, b): min_f64s, max(a, b): max_f64s, mul_add(a, b, c): mul_add_e_f64s},
    {less: less_than_f64s, equal: equal_f64s}, first_true_m64s, {u64, transmute_u64s_f64s, transmute_f64s_u64s, splat_u64s, equal_u64s, and_u64s, mul_u64s},
    {not_f64s, and_f64s, or_f64s});
