//! Functions of the joint coordinates: polynomials for prismatic joints, Fourier series for revolute ones.
//!
//! Products of sines and cosines are expanded into sums, so that each function has one form: equal functions compare
//! equal, and terms that cancel vanish.

use std::collections::BTreeMap;
use std::ops::{Add, Mul, Neg, Sub};

/// Joints of the largest tree that is written in closed form: equations of longer chains are too long to read.
pub const LONGEST_CLOSED_FORM: usize = 3;

/// One function of the basis: a monomial times a cosine or a sine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) struct Wave {
    /// Powers of the coordinates.
    pub powers: [u8; LONGEST_CLOSED_FORM],
    /// The angle is the sum of these multiples of the coordinates; the first non-zero one is positive.
    pub angle: [i8; LONGEST_CLOSED_FORM],
    pub is_sine: bool,
}

impl Wave {
    /// The power of length in its unit, which is that of its coordinates.
    pub fn lengths(&self) -> i32 {
        self.powers.iter().map(|power| i32::from(*power)).sum()
    }
}

/// A linear combination of basis functions.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Series {
    terms: BTreeMap<Wave, f64>,
}

impl Series {
    pub fn constant(value: f64) -> Self {
        Self::default().plus(Wave::default(), value)
    }

    /// The coordinate of a joint (counted from 0).
    pub fn coordinate(joint: usize) -> Self {
        let mut wave = Wave::default();
        wave.powers[joint] = 1;
        Self::default().plus(wave, 1.0)
    }

    /// The cosine of a joint's coordinate.
    pub fn cos(joint: usize) -> Self {
        let mut wave = Wave::default();
        wave.angle[joint] = 1;
        Self::default().plus(wave, 1.0)
    }

    /// The sine of a joint's coordinate.
    pub fn sin(joint: usize) -> Self {
        let mut wave = Wave::default();
        wave.angle[joint] = 1;
        wave.is_sine = true;
        Self::default().plus(wave, 1.0)
    }

    /// The terms in a fixed order.
    pub fn terms(&self) -> impl Iterator<Item = (&Wave, f64)> {
        self.terms.iter().map(|(wave, factor)| (wave, *factor))
    }

    pub fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }

    /// All but the constant term.
    pub fn without_constant(mut self) -> Self {
        self.terms.remove(&Wave::default());
        self
    }

    /// The derivative with respect to a joint's coordinate.
    pub fn derivative(&self, joint: usize) -> Self {
        let mut slope = Self::default();
        for (wave, factor) in self.terms() {
            let (power, times) = (wave.powers[joint], wave.angle[joint]);
            if power > 0 {
                let mut lower = *wave;
                lower.powers[joint] -= 1;
                slope = slope.plus(lower, factor * f64::from(power));
            }
            if times != 0 {
                let sign = if wave.is_sine { 1.0 } else { -1.0 };
                let other = Wave {
                    is_sine: !wave.is_sine,
                    ..*wave
                };
                slope = slope.plus(other, sign * factor * f64::from(times));
            }
        }
        slope
    }

    /// Without rounding errors: drops terms below 1e-13 of the magnitude that `scale` gives for terms of their kind.
    /// Other coefficients are rounded to 15 digits.
    pub fn cleaned(&self, scale: impl Fn(&Wave) -> f64) -> Self {
        let kept = self
            .terms()
            .filter(|(wave, factor)| factor.abs() > 1e-13 * scale(wave));
        Self {
            terms: kept
                .map(|(wave, factor)| (*wave, rounded(factor)))
                .collect(),
        }
    }

    /// The value at these coordinates.
    pub fn value(&self, q: &[f64]) -> f64 {
        self.terms()
            .map(|(wave, factor)| factor * wave.value(q))
            .sum()
    }

    /// Add a term in its normal form.
    fn plus(mut self, wave: Wave, factor: f64) -> Self {
        let (wave, sign) = wave.in_one_form();
        if sign * factor == 0.0 {
            return self;
        }
        let total = self.terms.entry(wave).or_insert(0.0);
        *total += sign * factor;
        if *total == 0.0 {
            self.terms.remove(&wave);
        }
        self
    }
}

impl Wave {
    /// cos(-a) = cos a, sin(-a) = -sin a, sin 0 = 0.
    fn in_one_form(mut self) -> (Self, f64) {
        match self.angle.iter().find(|times| **times != 0) {
            None if self.is_sine => (Self::default(), 0.0),
            Some(first) if *first < 0 => {
                self.angle = self.angle.map(|times| -times);
                (self, if self.is_sine { -1.0 } else { 1.0 })
            }
            _ => (self, 1.0),
        }
    }

    fn value(&self, q: &[f64]) -> f64 {
        let (mut monomial, mut angle) = (1.0, 0.0);
        for ((q, power), times) in q.iter().zip(self.powers).zip(self.angle) {
            monomial *= q.powi(i32::from(power));
            angle += q * f64::from(times);
        }
        monomial
            * if self.is_sine {
                angle.sin()
            } else {
                angle.cos()
            }
    }
}

/// To 15 significant digits.
pub fn rounded(number: f64) -> f64 {
    format!("{number:.14e}")
        .parse()
        .expect("a printed number is a number")
}

impl Add for &Series {
    type Output = Series;

    fn add(self, other: &Series) -> Series {
        let sum = self.clone();
        other
            .terms()
            .fold(sum, |sum, (wave, factor)| sum.plus(*wave, factor))
    }
}

impl Sub for &Series {
    type Output = Series;

    fn sub(self, other: &Series) -> Series {
        self + &-other
    }
}

impl Neg for &Series {
    type Output = Series;

    fn neg(self) -> Series {
        self * -1.0
    }
}

impl Mul<f64> for &Series {
    type Output = Series;

    fn mul(self, number: f64) -> Series {
        let scaled = Series::default();
        self.terms().fold(scaled, |sum, (wave, factor)| {
            sum.plus(*wave, number * factor)
        })
    }
}

impl Mul for &Series {
    type Output = Series;

    /// 2 cos a cos b = cos(a - b) + cos(a + b), 2 sin a sin b = cos(a - b) - cos(a + b),
    /// 2 sin a cos b = sin(a + b) + sin(a - b).
    fn mul(self, other: &Series) -> Series {
        let mut product = Series::default();
        for (a, left) in self.terms() {
            for (b, right) in other.terms() {
                let with = |sign: i8| Wave {
                    powers: std::array::from_fn(|j| a.powers[j] + b.powers[j]),
                    angle: std::array::from_fn(|j| a.angle[j] + sign * b.angle[j]),
                    is_sine: a.is_sine != b.is_sine,
                };
                let half = 0.5 * left * right;
                let [of_sum, of_difference] = match (a.is_sine, b.is_sine) {
                    (true, true) => [-half, half],
                    (false, true) => [half, -half],
                    _ => [half, half],
                };
                product = product.plus(with(1), of_sum).plus(with(-1), of_difference);
            }
        }
        product
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{LONGEST_CLOSED_FORM, Series};

    /// A function with every kind of term.
    fn random(rng: &mut ChaCha8Rng) -> Series {
        let mut series = Series::constant(rng.random_range(-1.0..1.0));
        for joint in 0..LONGEST_CLOSED_FORM {
            for basis in [Series::coordinate, Series::cos, Series::sin] {
                let factor = &basis(joint) * rng.random_range(-1.0..1.0);
                series = &(&series * &factor) + &basis((joint + 1) % LONGEST_CLOSED_FORM);
            }
        }
        series
    }

    #[test]
    fn sums_and_products_have_the_values_of_sums_and_products() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..20 {
            let (a, b) = (random(&mut rng), random(&mut rng));
            let q: [f64; LONGEST_CLOSED_FORM] =
                std::array::from_fn(|_| rng.random_range(-3.0..3.0));
            let close = |found: f64, wanted: f64| {
                assert!((found - wanted).abs() < 1e-11 * wanted.abs().max(1.0));
            };
            close((&a * &b).value(&q), a.value(&q) * b.value(&q));
            close((&a + &b).value(&q), a.value(&q) + b.value(&q));
            close((&a - &b).value(&q), a.value(&q) - b.value(&q));
        }
    }

    #[test]
    fn derivatives_are_slopes() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for _ in 0..20 {
            let a = random(&mut rng);
            let q: [f64; LONGEST_CLOSED_FORM] =
                std::array::from_fn(|_| rng.random_range(-2.0..2.0));
            for joint in 0..LONGEST_CLOSED_FORM {
                let at = |step: f64| {
                    let mut there = q;
                    there[joint] += step;
                    a.value(&there)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                let found = a.derivative(joint).value(&q);
                assert!((found - slope).abs() < 1e-7 * slope.abs().max(1.0));
            }
        }
    }

    #[test]
    fn terms_that_cancel_are_removed() {
        let (c1, s1) = (Series::cos(0), Series::sin(0));
        let (c2, s2) = (Series::cos(1), Series::sin(1));
        assert_eq!(&(&c1 * &c1) + &(&s1 * &s1), Series::constant(1.0));
        let sum = &(&c1 * &c2) - &(&s1 * &s2);
        assert_eq!(sum.terms().count(), 1, "cos(q1 + q2)");
        let difference = &(&c1 * &c2) + &(&s1 * &s2);
        assert_eq!(difference.terms().count(), 1, "cos(q1 - q2)");
        assert!((&sum - &sum).is_zero());
        assert_eq!(&s1 * &c2, &c2 * &s1);
        assert_eq!(sum.derivative(0), sum.derivative(1));
        assert!(Series::constant(3.0).derivative(0).is_zero());
    }

    #[test]
    fn rounding_errors_are_removed() {
        let dirty = &Series::constant(0.1 + 0.2) + &(&Series::cos(0) * 1e-17);
        assert_eq!(dirty.cleaned(|_| 1.0), Series::constant(0.3));
    }
}
