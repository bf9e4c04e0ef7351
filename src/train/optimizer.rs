//! Adam on the learnable numbers of a model. Burn's would take some thirty tensor operations for what is one loop over
//! a few hundred numbers.

use super::{FitSettings, Structure};
use crate::train::hybrid::Numbers;

/// Decay rates of the running means of the gradient and of its square.
const BETAS: [f32; 2] = [0.9, 0.999];
// PyTorch's value. Burn's default of 1e-5 is as large as gradients near the optimum of these losses,
// and would stop them short of it.
pub(super) const EPSILON: f32 = 1e-8;

/// Learning rates and weight decays of the prior and of the residual.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rates {
    learning: [f64; 2],
    /// Each weight decays by this share of its learning rate.
    decays: [f64; 2],
    /// The current share of the learning rates.
    share: f64,
}

/// Adam's moments of one part of a model.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Moments {
    /// Steps taken.
    pub steps: usize,
    /// Running means of the gradient and of its square.
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

/// Adam on the numbers of the prior and of the residual.
#[derive(Debug, Clone)]
pub(super) struct Optimizer {
    pub rates: Rates,
    pub moments: [Moments; 2],
}

impl Rates {
    pub(super) fn new(structure: &Structure, settings: &FitSettings) -> Self {
        let (rates, decay) = (&settings.learning_rates, settings.weight_decay);
        let (prior, of_prior) = match structure.equations {
            Some(_) => (rates.physics, 0.0),
            // A prior below a residual was trained before and must not decay.
            None if structure.has_residual => (rates.prior, 0.0),
            None => (rates.prior, decay),
        };
        Self {
            learning: [prior, rates.residual],
            decays: [of_prior, decay],
            share: 1.0,
        }
    }

    /// Sets the share of the learning rates for the next steps.
    pub(super) fn anneal(&mut self, share: f64) {
        self.share = share;
    }

    /// Learning rate of the prior (0) or of the residual (1), and what its weights are multiplied by before each step.
    pub(super) fn of(&self, part: usize) -> (f64, f64) {
        let rate = self.learning[part] * self.share;
        (rate, 1.0 - rate * self.decays[part])
    }
}

impl Optimizer {
    pub(super) fn new(structure: &Structure, settings: &FitSettings) -> Self {
        Self {
            rates: Rates::new(structure, settings),
            moments: Default::default(),
        }
    }

    /// Takes a step against these gradients.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn step(&mut self, numbers: &mut Numbers, gradients: &Numbers) {
        let parts = numbers.iter_mut().zip(gradients).zip(&mut self.moments);
        for (part, ((numbers, gradient), moments)) in parts.enumerate() {
            let (rate, kept) = self.rates.of(part);
            if kept < 1.0 {
                numbers.iter_mut().for_each(|x| *x *= kept as f32);
            }
            moments.step(numbers, gradient, rate as f32);
        }
    }
}

impl Moments {
    /// Algorithm 1 of Kingma and Ba 2015, "Adam: a method for stochastic optimization", arXiv:1412.6980, in the order
    /// of operations of its section 2.
    fn step(&mut self, numbers: &mut [f32], gradient: &[f32], rate: f32) {
        if numbers.is_empty() {
            return;
        }
        self.first.resize(numbers.len(), 0.0);
        self.second.resize(numbers.len(), 0.0);
        self.steps += 1;
        let steps = i32::try_from(self.steps).unwrap_or(i32::MAX);
        let [first, second] = BETAS.map(|beta| 1.0 - beta.powi(steps));
        let (factor, floor) = (second.sqrt() / first, EPSILON * second.sqrt());
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((x, slope), (first, second)) in numbers.iter_mut().zip(gradient).zip(moments) {
            *first = normal(*first * BETAS[0] + slope * (1.0 - BETAS[0]));
            *second = normal(*second * BETAS[1] + slope * slope * (1.0 - BETAS[1]));
            *x -= *first * factor / (second.sqrt() + floor) * rate;
        }
    }
}

/// Zero in place of a subnormal number. The moments of a weight whose gradient stays zero, as behind a ReLU that no row
/// activates, would decay into the subnormal range, where processors are slow.
fn normal(x: f32) -> f32 {
    if x.abs() < f32::MIN_POSITIVE { 0.0 } else { x }
}

#[cfg(test)]
mod tests {
    use burn::optim::{AdamConfig, Optimizer as _};
    use burn::tensor::Tensor;

    use super::{EPSILON, Moments};
    use crate::train::Backend;
    use crate::train::hybrid::vector;

    #[test]
    fn steps_are_those_of_burns_adam_to_the_last_bit() {
        let device = Backend::NdArray.device().without_autodiff();
        let adam = AdamConfig::new().with_epsilon(EPSILON).build();
        let start: [f64; 5] = [0.3, -1.7, 0.0, 12.0, -0.004];
        #[allow(clippy::cast_possible_truncation)]
        let mut numbers = start.map(|x| x as f32);
        let (mut tensor, mut state) = (vector(&start, &device), None);
        let mut moments = Moments::default();
        for step in 0..200 {
            let slopes: Vec<f64> = (0..5)
                .map(|k| {
                    f64::from((0.7 * f64::from(step * (k + 1))).sin() as f32) * 10f64.powi(k - 2)
                })
                .collect();
            let slopes: Vec<f32> = slopes.iter().map(|slope| *slope as f32).collect();
            moments.step(&mut numbers, &slopes, 3e-3);
            let gradient = Tensor::<1>::from_data(slopes.as_slice(), &device);
            (tensor, state) = adam.step(f64::from(3e-3_f32), tensor, gradient, state);
            let wanted: Vec<f32> = tensor.to_data().iter().collect();
            assert_eq!(numbers.as_slice(), wanted, "step {step}");
        }
    }
}
