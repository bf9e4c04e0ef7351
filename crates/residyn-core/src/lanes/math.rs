//! Sine, cosine, exponential and hyperbolic tangent of vectors, accurate to two units in the last place. Scalar code
//! and the rarer functions use the standard library.
//!
//! `scripts/polynomials` computes the polynomials and checks the coefficients here against them.

use pulp::Simd;

use super::{Element, Vector};

#[cfg(test)]
mod tests;

/// Constants of a number type. Polynomials start with the lowest power; each minimises the largest relative error of
/// its function among all polynomials of its degree (Remez 1934).
pub trait Constants: Sized + 'static {
    /// Adding and subtracting it rounds to an integer, which in between occupies the lowest bits.
    const ROUNDER: f64;
    /// pi / 2 as a sum; small multiples of the first terms are exact (Cody and Waite 1980).
    const QUARTER_TURN: [f64; 3];
    /// Largest angle that this sum reduces accurately enough, rad.
    const LARGEST_ANGLE: f64;
    /// log 2 as a sum.
    const LN_2: [f64; 2];
    /// Arguments below the first give 0, above the second infinity.
    const EXPONENTS: [f64; 2];
    /// (sin r - r) / r^3 and (cos r - 1 + r^2 / 2) / r^4 by r^2, for r up to pi / 4.
    const SINE: &'static [f64];
    const COSINE: &'static [f64];
    /// (exp r - 1 - r) / r^2 by r, for r up to log 2 / 2.
    const EXPONENTIAL: &'static [f64];
    /// (tanh x - x) / x^3 by x^2, for x up to 5 / 8.
    const TANGENT: &'static [f64];
}

impl Constants for f64 {
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    const QUARTER_TURN: [f64; 3] = [
        1.570_796_326_734_125_6,
        6.077_100_506_303_966e-11,
        2.022_266_248_795_950_6e-21,
    ];
    const LARGEST_ANGLE: f64 = 1e5;
    const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
    const EXPONENTS: [f64; 2] = [-746.0, 710.0];
    const SINE: &'static [f64] = &[
        -0.166_666_666_666_666_3,
        0.008_333_333_333_322_108,
        -0.000_198_412_698_295_809_93,
        2.755_731_361_828_611_5e-6,
        -2.505_074_725_744_916_2e-8,
        1.589_619_974_905_320_6e-10,
    ];
    const COSINE: &'static [f64] = &[
        0.041_666_666_666_666_595,
        -0.001_388_888_888_887_304_3,
        2.480_158_728_884_212_2e-5,
        -2.755_731_417_641_526_6e-7,
        2.087_570_043_621_029e-9,
        -1.135_851_483_053_011e-11,
    ];
    const EXPONENTIAL: &'static [f64] = &[
        0.5,
        0.166_666_666_666_666_82,
        0.041_666_666_666_666_095,
        0.008_333_333_333_317_035,
        0.001_388_888_888_911_575_4,
        0.000_198_412_698_963_824_75,
        2.480_158_692_644_338e-5,
        2.755_723_486_303_478_4e-6,
        2.755_758_198_018_014e-7,
        2.511_203_651_587_947e-8,
        2.082_659_238_994_117_6e-9,
    ];
    const TANGENT: &'static [f64] = &[
        -0.333_333_333_333_333_15,
        0.133_333_333_333_297_08,
        -0.053_968_253_966_039_61,
        0.021_869_488_468_186_364,
        -0.008_863_234_304_189_28,
        0.003_592_113_916_547_210_6,
        -0.001_455_725_407_635_055,
        0.000_589_449_474_724_533_6,
        -0.000_237_005_158_452_369_16,
        9.154_667_214_413_075e-5,
        -3.017_521_063_689_924e-5,
        6.037_107_295_572_100_5e-6,
    ];
}

impl Constants for f32 {
    const ROUNDER: f64 = 12_582_912.0;
    const QUARTER_TURN: [f64; 3] = [
        1.570_796_251_296_997,
        7.549_789_415_861_596e-8,
        5.390_302_529_957_765e-15,
    ];
    const LARGEST_ANGLE: f64 = 1e5;
    const LN_2: [f64; 2] = [0.693_145_751_953_125, 1.428_606_765_330_187e-6];
    const EXPONENTS: [f64; 2] = [-105.0, 89.0];
    const SINE: &'static [f64] = &[
        -0.166_666_545_991_796_5,
        0.008_332_160_165_004_564,
        -0.000_195_152_051_192_446_12,
    ];
    const COSINE: &'static [f64] = &[
        0.041_666_645_664_173_06,
        -0.001_388_731_537_794_747_8,
        2.443_305_949_576_347_4e-5,
    ];
    const EXPONENTIAL: &'static [f64] = &[
        0.500_000_006_768_185_5,
        0.166_666_658_680_661_72,
        0.041_666_294_948_832_58,
        0.008_333_497_266_228_715,
        0.001_394_465_964_229_863_4,
        0.000_197_902_436_621_001_5,
    ];
    const TANGENT: &'static [f64] = &[
        -0.333_333_307_895_671_9,
        0.133_332_054_580_538_15,
        -0.053_946_689_949_164_73,
        0.021_700_285_750_237_323,
        -0.008_176_328_233_767_363,
        0.002_141_950_437_785_587,
    ];
}

impl<S: Simd, T: Element> Vector<S, T> {
    #[inline(always)]
    pub fn sin(self) -> Self {
        self.sin_cos().0
    }

    #[inline(always)]
    pub fn cos(self) -> Self {
        self.sin_cos().1
    }

    /// Sine and cosine; costs hardly more than one of them.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        if S::IS_SCALAR || self.like(T::LARGEST_ANGLE).any_less(self.abs()) {
            return (self.each(T::sin), self.each(T::cos));
        }
        let rounder = self.like(T::ROUNDER);
        let turns = self.mul_add(self.like(std::f64::consts::FRAC_2_PI), rounder);
        let count = -(turns - rounder);
        let [first, second, third] = T::QUARTER_TURN;
        let most = count.mul_add(self.like(first), self);
        let rest = count.mul_add(self.like(second), most);
        let angle = count.mul_add(self.like(third), rest);
        let square = angle * angle;
        let odd = (angle * square).mul_add(square.polynomial(T::SINE), angle);
        // 1 - r^2 / 2 first, with its rounding error added to the small term.
        let half = square * self.like(0.5);
        let one = self.like(1.0);
        let large = one - half;
        let small = (square * square).mul_add(square.polynomial(T::COSINE), (one - large) - half);
        let (odd, even) = (odd.with_sign_of(angle), large + small);
        let (sine, cosine) = (turns.if_bit(0, even, odd), turns.if_bit(0, odd, even));
        // The sine is negative in quadrants 3 and 4, the cosine in quadrants 2 and 3.
        let middle = turns + one;
        (
            turns.if_bit(1, -sine, sine),
            middle.if_bit(1, -cosine, cosine),
        )
    }

    #[inline(always)]
    pub fn exp(self) -> Self {
        if S::IS_SCALAR {
            return self.each(T::exp);
        }
        let (low, high) = (self.like(T::EXPONENTS[0]), self.like(T::EXPONENTS[1]));
        let inside = self.if_less(low, low, high.if_less(self, high, self));
        let (power, factor) = inside.split_exp();
        // In two factors, since 2^k alone may overflow where the result does not.
        let rounder = self.like(T::ROUNDER);
        let half = power.mul_add(self.like(0.5), rounder) - rounder;
        factor * half.power_of_two() * (power - half).power_of_two()
    }

    #[inline(always)]
    pub fn tanh(self) -> Self {
        if S::IS_SCALAR {
            return self.each(T::tanh);
        }
        let (size, square, one) = (self.abs(), self * self, self.like(1.0));
        let near = (self * square).mul_add(square.polynomial(T::TANGENT), self);
        // 1 - 2 / (exp(2 |x|) + 1), beyond 20 one to the last bit.
        let most = self.like(20.0);
        let double = most.if_less(size, most, size) * self.like(2.0);
        let (power, factor) = double.split_exp();
        let far = one - self.like(2.0) / factor.mul_add(power.power_of_two(), one);
        size.if_less(self.like(0.625), near, far).with_sign_of(self)
    }

    #[inline(always)]
    pub fn tan(self) -> Self {
        self.each(T::tan)
    }

    #[inline(always)]
    pub fn ln(self) -> Self {
        self.each(T::ln)
    }

    #[inline(always)]
    pub fn pow(self, exponent: Self) -> Self {
        self.each_with(exponent, T::powf)
    }

    #[inline(always)]
    pub fn atan2(self, x: Self) -> Self {
        self.each_with(x, T::atan2)
    }

    /// -1, 0 or 1.
    #[inline(always)]
    pub fn sign(self) -> Self {
        let zero = self.like(0.0);
        let not_positive = self.if_less(zero, self.like(-1.0), self * zero);
        zero.if_less(self, self.like(1.0), not_positive)
    }

    /// Integer k and factor f with exp(self) = 2^k f.
    #[inline(always)]
    fn split_exp(self) -> (Self, Self) {
        let rounder = self.like(T::ROUNDER);
        let power = self.mul_add(self.like(std::f64::consts::LOG2_E), rounder) - rounder;
        let [first, second] = T::LN_2;
        let most = power.mul_add(self.like(-first), self);
        let left = power.mul_add(self.like(-second), most);
        let curved = (left * left).mul_add(left.polynomial(T::EXPONENTIAL), left);
        (power, curved + self.like(1.0))
    }

    /// Even and odd powers separately, which halves the latency.
    #[inline(always)]
    fn polynomial(self, coefficients: &[f64]) -> Self {
        let (zero, square) = (self.like(0.0), self * self);
        let (mut even, mut odd) = (zero, zero);
        for pair in coefficients.chunks(2).rev() {
            even = even.mul_add(square, self.like(pair[0]));
            odd = odd.mul_add(
                square,
                self.like(if pair.len() > 1 { pair[1] } else { 0.0 }),
            );
        }
        odd.mul_add(self, even)
    }

    #[inline(always)]
    fn if_bit(self, bit: u32, then: Self, otherwise: Self) -> Self {
        then.where_in(T::bit(self.simd, self.register, bit), otherwise)
    }
}
