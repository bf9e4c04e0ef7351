use std::f64::consts::TAU;
use std::sync::Arc;

use rand::Rng;

use super::gaussian::Gaussian;
use residyn_core::lanes::{Arch, Simd, WithSimd};
use residyn_core::sim::batch::{Finish, Product, Rows};

/// Normal noise of unit variance for candidate sequences, white or coloured.
#[derive(Debug, Clone)]
pub struct Noise {
    gaussian: Gaussian,
    colour: Option<Colour>,
}

/// Temporally correlated noise: its power spectrum falls with frequency.
#[derive(Debug, Clone)]
struct Colour {
    steps: usize,
    inputs: usize,
    /// Contribution of each of `steps` independent numbers to each step: `[number][step]`.
    mixing: Arc<[f32]>,
    /// `[input * steps + number]`
    white: Vec<Rows>,
    /// The coloured sequence of one input, `[step]`.
    sequence: Vec<Rows>,
}

impl Noise {
    /// Independent numbers.
    pub fn white(steps: usize, inputs: usize) -> Self {
        Self {
            gaussian: Gaussian::new(steps * inputs),
            colour: None,
        }
    }

    /// Independent between inputs, with the power spectrum f^-`exponent` over the steps (Timmer and König 1995).
    pub fn coloured(steps: usize, inputs: usize, exponent: f64) -> Self {
        let colour = Colour {
            steps,
            inputs,
            mixing: mixing(steps, exponent).into(),
            white: vec![Rows::splat(0.0); steps * inputs],
            sequence: vec![Rows::splat(0.0); steps],
        };
        Self {
            colour: Some(colour),
            ..Self::white(steps, inputs)
        }
    }

    /// Write the next numbers, `[step * n + input]`.
    pub(super) fn fill(&mut self, arch: Arch, rng: &mut impl Rng, rows: &mut [Rows]) {
        let Some(colour) = &mut self.colour else {
            return self.gaussian.fill(arch, rng, rows);
        };
        self.gaussian.fill(arch, rng, &mut colour.white);
        arch.dispatch(Mix { colour, rows });
    }
}

struct Mix<'a> {
    colour: &'a mut Colour,
    rows: &'a mut [Rows],
}

impl WithSimd for Mix<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let colour = self.colour;
        let product = Product {
            weight: &colour.mixing,
            bias: &[],
            finish: Finish::Plain,
        };
        for (input, white) in colour.white.chunks(colour.steps).enumerate() {
            product.run(simd, white, &mut colour.sequence);
            let rows = self.rows[input..].iter_mut().step_by(colour.inputs);
            for (row, number) in rows.zip(&colour.sequence) {
                *row = *number;
            }
        }
    }
}

/// The inverse Fourier transform with normalised waves of amplitude f^(-exponent / 2). The constant has the amplitude
/// of the lowest frequency; the variance of every step is 1.
#[allow(clippy::cast_possible_truncation)] // planning runs in f32
fn mixing(steps: usize, exponent: f64) -> Vec<f32> {
    // Constant, cosine, sine, cosine, sine, ...
    let frequency = |number: usize| number.div_ceil(2);
    let amplitude = |number: usize| (frequency(number).max(1) as f64).powf(-0.5 * exponent);
    let power: f64 = (0..steps).map(|number| amplitude(number).powi(2)).sum();
    let entry = |number: usize, step: usize| {
        let turns = (frequency(number) * step) as f64 / steps as f64;
        // The constant and the highest frequency have no sine.
        let alone = (2 * frequency(number)).is_multiple_of(steps);
        let energy = if alone { 1.0 } else { 2.0 };
        let is_sine = number > 0 && number.is_multiple_of(2);
        let quarter = if is_sine { 0.25 } else { 0.0 };
        let wave = (TAU * (turns - quarter)).cos();
        (amplitude(number) * (energy / power).sqrt() * wave) as f32
    };
    let numbers = 0..steps;
    numbers
        .flat_map(|number| (0..steps).map(move |step| (number, step)))
        .map(|(n, s)| entry(n, s))
        .collect()
}
