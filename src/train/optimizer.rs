use burn::optim::{Adam, AdamConfig, AdamState, AdaptiveMomentumState, Optimizer as _};
use burn::tensor::{Device, Gradients, Tensor, TensorData};

use super::{FitSettings, Structure};

// PyTorch's value. Burn's default of 1e-5 is as large as gradients near the optimum of these losses,
// and would stop them short of it.
const ADAM_EPSILON: f32 = 1e-8;

/// Adam on the two tensors of one model (`D` = 1) or of many (`D` = 2), each tensor with its own learning rate.
#[derive(Clone)]
pub(super) struct Optimizer<const D: usize> {
    adam: Adam,
    rates: [f64; 2],
    /// Each weight decays by this share of its learning rate.
    decays: [f64; 2],
    /// The current share of the learning rates.
    share: f64,
    /// Of the prior and of the residual; none before their first step.
    moments: [Option<AdamState<D>>; 2],
}

/// Adam's moments of one tensor as plain numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moments {
    /// Steps taken.
    pub steps: usize,
    /// Running means of the gradient and of its square.
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl<const D: usize> Optimizer<D> {
    pub(super) fn new(structure: &Structure, settings: &FitSettings) -> Self {
        let (rates, decay) = (&settings.learning_rates, settings.weight_decay);
        let (prior, of_prior) = match structure.equations {
            Some(_) => (rates.physics, 0.0),
            // A prior below a residual was trained before and must not decay.
            None if structure.has_residual => (rates.prior, 0.0),
            None => (rates.prior, decay),
        };
        Self {
            adam: AdamConfig::new().with_epsilon(ADAM_EPSILON).build(),
            rates: [prior, rates.residual],
            decays: [of_prior, decay],
            share: 1.0,
            moments: [None, None],
        }
    }

    /// Sets the share of the learning rates for the next steps.
    pub(super) fn anneal(&mut self, share: f64) {
        self.share = share;
    }

    /// The tensors of prior and residual after a step against these gradients.
    pub(super) fn step(
        &mut self,
        mut tensors: [Option<Tensor<D>>; 2],
        mut gradients: Gradients,
    ) -> [Option<Tensor<D>>; 2] {
        let each = tensors
            .iter_mut()
            .zip(self.rates)
            .zip(self.decays)
            .zip(&mut self.moments);
        for (((tensor, rate), decay), moments) in each {
            let Some(numbers) = tensor.take() else {
                continue;
            };
            if let Some(gradient) = numbers.grad_remove(&mut gradients) {
                let rate = rate * self.share;
                let plain = decayed(numbers.inner(), rate * decay);
                let (stepped, after) = self.adam.step(rate, plain, gradient, moments.take());
                *moments = after.map(without_subnormals);
                *tensor = Some(Tensor::from_inner(stepped));
            }
        }
        tensors
    }
}

fn decayed<const D: usize>(numbers: Tensor<D>, share: f64) -> Tensor<D> {
    if share > 0.0 {
        numbers * (1.0 - share)
    } else {
        numbers
    }
}

impl Optimizer<1> {
    /// The moments of the prior and of the residual.
    pub(super) fn moments(&self) -> [Option<Moments>; 2] {
        let numbers = |tensor: &Tensor<1>| tensor.to_data().iter().collect();
        self.moments.each_ref().map(|state| {
            let momentum = &state.as_ref()?.momentum;
            Some(Moments {
                steps: momentum.time,
                first: numbers(&momentum.moment_1),
                second: numbers(&momentum.moment_2),
            })
        })
    }

    /// Continues from these moments; `device` is the model's.
    pub(super) fn resume(&mut self, moments: [Option<Moments>; 2], device: &Device) {
        let plain = device.clone().without_autodiff();
        let tensor = |numbers: Vec<f32>| {
            let shape = [numbers.len()];
            Tensor::from_data(TensorData::new(numbers, shape), &plain)
        };
        self.moments = moments.map(|moments| {
            let Moments {
                steps,
                first,
                second,
            } = moments?;
            let momentum = AdaptiveMomentumState::new(steps, tensor(first), tensor(second));
            Some(AdamState::new(momentum))
        });
    }
}

/// Sets subnormal moments to zero, every 32 steps. The moments of a weight whose gradient stays zero, as behind a ReLU
/// that no row activates, would decay into the subnormal range, where processors are slow.
fn without_subnormals<const D: usize>(mut state: AdamState<D>) -> AdamState<D> {
    let momentum = &mut state.momentum;
    if !momentum.time.is_multiple_of(32) {
        return state;
    }
    for moment in [&mut momentum.moment_1, &mut momentum.moment_2] {
        let subnormal = moment.clone().abs().lower_elem(f32::MIN_POSITIVE);
        *moment = moment.clone().mask_fill(subnormal, 0.0);
    }
    state
}
