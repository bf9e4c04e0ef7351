use burn::optim::{Adam, AdamConfig, AdamState, AdaptiveMomentumState, Optimizer};
use burn::tensor::{Device, Gradients, Tensor, TensorData};

use super::LearningRates;
use crate::model::HybridModel;

// PyTorch's value. Burn's default of 1e-5 is as large as gradients near the optimum of these losses,
// and would stop them short of it.
const ADAM_EPSILON: f32 = 1e-8;

/// Adam on the two tensors of a model, each with a learning rate of its own.
#[derive(Clone)]
pub(super) struct Stepper {
    adam: Adam,
    rates: [f64; 2],
    /// Of the prior and of the residual; none before their first step.
    moments: [Option<AdamState<1>>; 2],
}

/// What Adam remembers of one tensor, in plain form.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moments {
    /// Steps taken.
    pub steps: usize,
    /// Running means of the gradient and of its square.
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl Stepper {
    pub(super) fn new(model: &HybridModel, rates: &LearningRates) -> Self {
        let prior = match model.frame().equations {
            Some(_) => rates.physics,
            None => rates.prior,
        };
        Self {
            adam: AdamConfig::new().with_epsilon(ADAM_EPSILON).build(),
            rates: [prior, rates.residual],
            moments: [None, None],
        }
    }

    /// The model after a step against these gradients.
    pub(super) fn step(&mut self, model: &HybridModel, mut gradients: Gradients) -> HybridModel {
        let mut tensors = model.tensors();
        let each = tensors.iter_mut().zip(self.rates).zip(&mut self.moments);
        for ((tensor, rate), moments) in each {
            let Some(numbers) = tensor.take() else {
                continue;
            };
            if let Some(gradient) = numbers.grad_remove(&mut gradients) {
                let plain = numbers.inner();
                let (stepped, after) = self.adam.step(rate, plain, gradient, moments.take());
                *moments = after.map(without_subnormals);
                *tensor = Some(Tensor::from_inner(stepped));
            }
        }
        model.with_tensors(tensors)
    }

    /// What is remembered of the prior and of the residual.
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

    /// Go on from what was remembered; `device` is the model's.
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

/// Every so many steps, numbers below the smallest normal f32 become zero. The moments of a weight whose gradient has
/// become zero for good, as below a neuron that no row reaches, would shrink into them and stay there, where
/// processors are slow.
fn without_subnormals(mut state: AdamState<1>) -> AdamState<1> {
    let momentum = &mut state.momentum;
    if !momentum.time.is_multiple_of(32) {
        return state;
    }
    for moment in [&mut momentum.moment_1, &mut momentum.moment_2] {
        let device = moment.device();
        let taken = std::mem::replace(moment, Tensor::empty([0], &device));
        let mut data = taken.into_data();
        for number in data.as_mut_slice::<f32>().expect("training runs in f32") {
            *number = if number.abs() < f32::MIN_POSITIVE {
                0.0
            } else {
                *number
            };
        }
        *moment = Tensor::from_data(data, &device);
    }
    state
}
