//! Many independent models of one structure trained as one batch, for devices that one model leaves idle.

use std::ops::Range;

use burn::optim::{Adam, AdamConfig, AdamState, Optimizer};
use burn::tensor::{Bool, Gradients, Tensor};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::hybrid::{to_f64, vector};
use super::optimizer::{EPSILON, Rates};
use super::{
    Batching, Columns, FitSettings, HybridModel, Objective, Penalty, Segments, Stack,
    SweepProgress, TrainError, Trained, Variant,
};

/// A run of many models. The sum of their losses is minimised, in which each model has numbers of its own: every gradient
/// and every step of Adam, which goes entry by entry, is that of a model alone. One whose loss is no longer finite
/// stays as it is from then on and harms no other.
pub(super) struct StackedSweep {
    stack: Stack,
    settings: FitSettings,
    objective: Objective,
    rates: Rates,
    adam: Adam,
    /// Of the priors and of the residuals; none before their first step.
    moments: [Option<AdamState<2>>; 2],
    /// Of the minibatches of each model.
    orders: Vec<ChaCha8Rng>,
    /// alpha, or the present lambda, of each model.
    penalty_weights: Vec<f64>,
    /// What E and ||F_r|| are multiplied by, `[models]` each.
    weights: [Tensor<1>; 2],
    /// Whether all losses of a model were finite so far, `[models]`.
    alive: Tensor<1, Bool>,
}

/// The error of a batch before its step.
struct BatchError {
    /// The batch's share of all segments.
    share: f64,
    /// The prediction error of each model, `[models]`.
    error: Tensor<1>,
}

impl StackedSweep {
    /// A run that has not begun: copies of `model`, one for each variant. The model must be on a device
    /// with gradients and have a network.
    ///
    /// # Errors
    /// Settings that are out of range.
    ///
    /// # Panics
    /// When there are no variants, or with networks that are not of the shape of the model's own.
    pub(super) fn new(
        model: &HybridModel,
        settings: FitSettings,
        variants: Vec<Variant>,
    ) -> Result<Self, TrainError> {
        settings.check()?;
        let scale = settings.error_scale.as_deref();
        let objective = Objective::new(settings.integrator, scale, model.joints())?;
        let penalty_weights: Vec<f64> = variants.iter().map(|s| s.penalty_weight).collect();
        let (networks, orders): (Vec<_>, Vec<_>) = (variants.into_iter())
            .map(|variant| (variant.network, variant.order))
            .unzip();
        let stack = Stack::new(model, &networks);
        let weights = [(); 2].map(|()| Tensor::zeros([networks.len()], &stack.device()));
        let mut sweep = Self {
            alive: weights[0].clone().inner().is_finite(),
            rates: Rates::new(model.structure(), &settings),
            adam: AdamConfig::new().with_epsilon(EPSILON).build(),
            moments: [None, None],
            weights,
            stack,
            orders,
            penalty_weights,
            objective,
            settings,
        };
        sweep.weights = sweep.weights_on_device();
        Ok(sweep)
    }

    /// Trains to the last epoch; `observer` is called after each.
    ///
    /// # Errors
    /// Segments that do not fit the model.
    pub(super) fn run(
        &mut self,
        segments: &Segments,
        observer: &mut dyn FnMut(SweepProgress),
    ) -> Result<Vec<Trained>, TrainError> {
        segments.check_for(self.stack.structure(), "training")?;
        let whole = self.columns(segments, &self.in_order(segments), 0..segments.len());
        let mut diverged = 0;
        for epoch in 1..=self.settings.epochs {
            self.rates.anneal(self.settings.share_in(epoch - 1));
            let steps = self.run_epoch(segments, &whole);
            self.reweigh(steps);
            // Only now and then, since it waits for the device.
            if epoch.is_multiple_of(self.settings.record_every.get()) {
                diverged = self
                    .diverged()
                    .into_iter()
                    .filter(|diverged| *diverged)
                    .count();
            }
            observer(SweepProgress { diverged });
        }
        Ok(self.evaluate(&whole))
    }

    fn run_epoch(&mut self, segments: &Segments, whole: &Columns) -> Vec<BatchError> {
        let Batching::Mini { size } = self.settings.batching else {
            return vec![self.step(whole, 1.0)];
        };
        let mut orders = self.in_order(segments);
        for (order, rng) in orders.iter_mut().zip(&mut self.orders) {
            order.shuffle(rng);
        }
        let firsts = (0..segments.len()).step_by(size.get());
        firsts
            .map(|first| {
                let chosen = first..segments.len().min(first + size.get());
                let share = chosen.len() as f64 / segments.len() as f64;
                self.step(&self.columns(segments, &orders, chosen), share)
            })
            .collect()
    }

    /// One step of the optimiser on one batch, which is so large a `share` of all segments.
    fn step(&mut self, batch: &Columns, share: f64) -> BatchError {
        let rows = batch.size / self.stack.models();
        let unpacked = self.stack.unpack(rows);
        let [error, norm] = self
            .objective
            .of_each(self.stack.models(), &unpacked, batch);
        let before = error.clone().inner();
        let [of_error, of_norm] = self.weights.clone();
        let losses = error * of_error + norm * of_norm;
        self.alive = (self.alive.clone()).bool_and(losses.clone().inner().is_finite());
        // Backwards from every loss at once, as from their sum.
        let stepped = self.stepped(losses.backward());
        self.stack = self.stack.stepped(stepped, &self.alive);
        BatchError {
            share,
            error: before,
        }
    }

    /// The tensors of priors and residuals after a step of Adam, which goes entry by entry.
    fn stepped(&mut self, mut gradients: Gradients) -> [Option<Tensor<2>>; 2] {
        let mut tensors = self.stack.tensors();
        for (part, tensor) in tensors.iter_mut().enumerate() {
            let Some(numbers) = tensor.take() else {
                continue;
            };
            let gradient = numbers.grad_remove(&mut gradients);
            let gradient = gradient.expect("every part is learnable");
            let (rate, kept) = self.rates.of(part);
            let moments = self.moments[part].take();
            let (stepped, moments) =
                (self.adam).step(rate, numbers.inner() * kept, gradient, moments);
            self.moments[part] = moments;
            *tensor = Some(Tensor::from_inner(stepped));
        }
        tensors
    }

    /// Updates the weights of the penalty after an epoch, as a run of one model does.
    fn reweigh(&mut self, steps: Vec<BatchError>) {
        // Nothing changes; reading the errors would wait for the device.
        if let Penalty::Fixed { .. } = self.settings.penalty {
            return;
        }
        let mut means = vec![0.0; self.penalty_weights.len()];
        for BatchError { share, error } in steps {
            for (mean, error) in means.iter_mut().zip(to_f64(error)) {
                *mean += share * error;
            }
        }
        for (weight, error) in self.penalty_weights.iter_mut().zip(means) {
            *weight = self.settings.penalty.next(*weight, error);
        }
        self.weights = self.weights_on_device();
    }

    fn weights_on_device(&self) -> [Tensor<1>; 2] {
        let has_residual = self.stack.structure().has_residual;
        let weigh = |weight: &f64| self.settings.penalty.weights(*weight, has_residual);
        [0, 1].map(|part| {
            let weights = self.penalty_weights.iter().map(|w| weigh(w)[part]);
            vector(&weights.collect::<Vec<_>>(), &self.stack.device())
        })
    }

    fn evaluate(&self, whole: &Columns) -> Vec<Trained> {
        let models = self.stack.models();
        let unpacked = self.stack.unpack(whole.size / models);
        let parts = self.objective.of_each(models, &unpacked, whole);
        let [error, norm] = parts.map(to_f64);
        let found = error.into_iter().zip(norm).zip(self.stack.parameters());
        found
            .zip(self.diverged())
            .map(|(((error, residual_norm), parameters), diverged)| Trained {
                diverged: diverged || !(error + residual_norm).is_finite(),
                error,
                residual_norm,
                parameters,
            })
            .collect()
    }

    fn diverged(&self) -> Vec<bool> {
        self.alive
            .clone()
            .bool_not()
            .into_data()
            .iter::<bool>()
            .collect()
    }

    /// For each model all segments as they come.
    fn in_order(&self, segments: &Segments) -> Vec<Vec<usize>> {
        vec![(0..segments.len()).collect(); self.stack.models()]
    }

    /// The `chosen` of each model's order, one model's after the other's.
    fn columns(&self, segments: &Segments, orders: &[Vec<usize>], chosen: Range<usize>) -> Columns {
        let rows = orders.iter().flat_map(|order| &order[chosen.clone()]);
        segments.columns(&rows.copied().collect::<Vec<_>>(), &self.stack.device())
    }
}
