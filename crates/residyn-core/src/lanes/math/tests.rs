use pulp::{Arch, Simd, WithSimd};

use crate::lanes::{Element, Vector};

/// A function on vectors and its reference.
#[derive(Clone, Copy)]
enum Function {
    Sin,
    Cos,
    Exp,
    Tanh,
}

use Function::{Cos, Exp, Sin, Tanh};

impl Function {
    fn of_number(self, x: f64) -> f64 {
        match self {
            Sin => x.sin(),
            Cos => x.cos(),
            Exp => x.exp(),
            Tanh => x.tanh(),
        }
    }

    fn of_vector<S: Simd, T: Element>(self, x: Vector<S, T>) -> Vector<S, T> {
        match self {
            Sin => x.sin(),
            Cos => x.cos(),
            Exp => x.exp(),
            Tanh => x.tanh(),
        }
    }
}

struct Apply<'a, T>(Function, &'a [T]);

impl<T: Element> WithSimd for Apply<'_, T> {
    type Output = Vec<T>;

    fn with_simd<S: Simd>(self, simd: S) -> Vec<T> {
        let mut numbers = self.1.to_vec();
        numbers.resize(numbers.len().next_multiple_of(16), T::zero());
        for register in T::registers_mut::<S>(&mut numbers) {
            *register = self
                .0
                .of_vector(Vector::<S, T>::new(simd, *register))
                .register;
        }
        numbers
    }
}

/// The function on every set of instructions that this processor has; on plain numbers it is the standard library's.
fn everywhere<T: Element>(function: Function, x: &[T]) -> Vec<Vec<T>> {
    let apply = || Apply(function, x);
    let mut all = vec![Arch::new().dispatch(apply())];
    #[cfg(target_arch = "x86_64")]
    all.extend(pulp::x86::V3::try_new().map(|simd| Simd::vectorize(simd, apply())));
    all
}

/// Evenly spread numbers, and multiples of a quarter of pi, near to which sines and cosines vanish.
fn arguments(largest: f64) -> Vec<f64> {
    let spread = (0..40_000).map(|k| largest * (f64::from(k) / 20_000.0 - 1.0));
    let multiples = (-2000..2000).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4);
    let small = (0..300).map(|k| 1.3 * 0.9_f64.powi(k));
    let all = spread.chain(multiples).chain(small);
    all.filter(|x| x.abs() <= largest).collect()
}

const CASES: [(Function, f64); 8] = [
    (Sin, 1e5),
    (Cos, 1e5),
    (Sin, 10.0),
    (Cos, 10.0),
    (Exp, 740.0),
    (Exp, 2.0),
    (Tanh, 25.0),
    (Tanh, 1.0),
];

#[test]
fn doubles_are_within_two_units_of_the_standard_library() {
    for (function, largest) in CASES {
        let x = arguments(largest);
        for found in everywhere(function, &x) {
            for (x, found) in x.iter().zip(found) {
                let wanted = function.of_number(*x);
                let unit = wanted.abs().next_up() - wanted.abs();
                let off = (found - wanted).abs();
                assert!(
                    found == wanted || off <= 2.0 * unit,
                    "{x:e}: {found:e} {wanted:e}"
                );
            }
        }
    }
}

#[test]
fn floats_are_within_two_units_of_the_truth() {
    for (function, largest) in CASES {
        let x: Vec<f32> = arguments(largest.min(100.0))
            .iter()
            .map(|x| *x as f32)
            .collect();
        for found in everywhere(function, &x) {
            for (x, found) in x.iter().zip(found) {
                let wanted = function.of_number(f64::from(*x));
                let nearest = wanted as f32;
                let unit = f64::from(nearest.abs().next_up() - nearest.abs());
                let off = (f64::from(found) - wanted).abs();
                assert!(
                    found == nearest || off <= 2.0 * unit,
                    "{x:e}: {found:e} {wanted:e}"
                );
            }
        }
    }
}

#[test]
fn nan_and_infinity_give_what_the_standard_library_gives() {
    let x = [
        f64::NAN,
        f64::INFINITY,
        -f64::INFINITY,
        -0.0,
        0.0,
        1e300,
        -1e6,
        3e5,
        5e-324,
        709.7,
        -745.0,
    ];
    for function in [Sin, Cos, Exp, Tanh] {
        // Separately, since one large angle sends all lanes down the slow path.
        for x in x {
            for found in everywhere(function, &[x; 3]) {
                let wanted = function.of_number(x);
                let close = (found[0] - wanted).abs() <= 4e-16 * wanted.abs();
                let same =
                    found[0] == wanted && found[0].is_sign_negative() == wanted.is_sign_negative();
                assert!(
                    same || close && wanted != 0.0 || found[0].is_nan() && wanted.is_nan(),
                    "{x} {} {wanted}",
                    found[0]
                );
            }
        }
    }
}
