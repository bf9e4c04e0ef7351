use std::ops::ControlFlow;

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::optimizer::Optimizer;
use super::packed::Packed;
use super::{Batch, Batching, Best, FitSettings, Objective, Record, Segments, TrainError};
use crate::HybridModel;

/// A training run, which can be saved, loaded and continued. Interruptions do not change its
/// result by a bit on the same backend and machine.
#[derive(Clone)]
pub struct Training {
    /// The model at the start of the run.
    model: HybridModel,
    /// Its current numbers.
    numbers: Packed,
    pub(super) settings: FitSettings,
    pub(super) optimizer: Optimizer,
    pub(super) rng: ChaCha8Rng,
    pub(super) epoch: usize,
    pub(super) penalty_weight: f64,
    pub(super) history: Vec<Record>,
    pub(super) best: Option<Best>,
    pub(super) objective: Objective,
}

/// The progress of a run, after each epoch.
pub struct Progress<'a> {
    /// Epochs done.
    pub epoch: usize,
    /// Epochs of the whole run.
    pub epochs: usize,
    /// The minimised loss in this epoch: mean over its batches, before their steps.
    pub loss: f64,
    /// The prediction error in this epoch.
    pub error: f64,
    /// The run itself, for its history and to save it.
    pub training: &'a Training,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// All epochs are done.
    Finished,
    /// The observer asked to stop; the run can be continued.
    Stopped,
}

/// The data of a run.
struct Batches<'a> {
    segments: &'a Segments,
    /// All segments, on a device with gradients.
    training: Batch,
    /// All segments, on a device without gradients.
    evaluation: Batch,
    validation: Option<Batch>,
}

/// Means over an epoch.
#[derive(Clone, Copy, Default)]
struct Epoch {
    loss: f64,
    error: f64,
}

impl Training {
    /// A run that has not begun. `model` must be on a device with gradients
    /// ([`Backend::device`](super::Backend::device)); `rng` orders the minibatches.
    ///
    /// # Errors
    /// Settings that are out of range.
    pub fn new(
        model: HybridModel,
        settings: FitSettings,
        rng: ChaCha8Rng,
    ) -> Result<Self, TrainError> {
        settings.check()?;
        let numbers = Packed::of(&model, &settings);
        Ok(Self {
            objective: Objective::new(
                settings.integrator,
                settings.error_scale.as_deref(),
                model.joints(),
            )?,
            optimizer: Optimizer::new(&model, &numbers, &settings)?,
            epoch: 0,
            penalty_weight: settings.penalty.initial(),
            history: Vec::new(),
            best: None,
            model,
            numbers,
            settings,
            rng,
        })
    }

    /// Trains until all epochs are done or `observer`, called after each, asks to stop; called again, it continues.
    /// With `validation`, the model with the lowest validation error is kept, including the one before training.
    ///
    /// # Errors
    /// Segments that do not fit the model, or a loss that is no longer finite: numbers are never repaired.
    pub fn run(
        &mut self,
        segments: &Segments,
        validation: Option<&Segments>,
        observer: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Ended, TrainError> {
        segments.check_for(self.model.structure(), "training")?;
        let device = self.model.device();
        let plain = device.clone().without_autodiff();
        if let Some(validation) = validation {
            validation.check_for(self.model.structure(), "validation")?;
        }
        let batches = Batches {
            segments,
            training: self.objective.all(segments, &device),
            evaluation: self.objective.all(segments, &plain),
            validation: validation.map(|segments| self.objective.all(segments, &plain)),
        };
        let workers = self.objective.workers();
        workers.with_workers(|| self.run_epochs(&batches, observer))
    }

    fn run_epochs(
        &mut self,
        batches: &Batches,
        observer: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Ended, TrainError> {
        if self.history.is_empty() {
            self.record(batches)?;
        }
        while self.epoch < self.settings.epochs {
            self.optimizer.begin_epoch();
            let Epoch { loss, error } = self.run_epoch(batches)?;
            self.epoch += 1;
            self.penalty_weight = self.settings.penalty.next(self.penalty_weight, error);
            let every = self.settings.record_every.get();
            if self.epoch.is_multiple_of(every) || self.epoch == self.settings.epochs {
                self.record(batches)?;
            }
            let progress = Progress {
                epoch: self.epoch,
                epochs: self.settings.epochs,
                loss,
                error,
                training: self,
            };
            if observer(&progress).is_break() {
                return Ok(Ended::Stopped);
            }
        }
        Ok(Ended::Finished)
    }

    /// The current model.
    pub fn model(&self) -> HybridModel {
        self.numbers.unpacked(&self.model)
    }

    /// The result: the best model by validation error, or the current one without validation.
    ///
    /// # Errors
    /// None for a run made or loaded by this module.
    pub fn result(&self) -> Result<HybridModel, TrainError> {
        match &self.best {
            Some(best) => Ok(self.model.with_weights(&best.weights)?),
            None => Ok(self.model()),
        }
    }

    /// The run as it ended, with another model as its result.
    ///
    /// # Errors
    /// None for a run made or loaded by this module.
    pub(super) fn ending_in(self, model: HybridModel) -> Result<Self, TrainError> {
        Ok(Self {
            epoch: self.epoch,
            penalty_weight: self.penalty_weight,
            history: self.history,
            ..Self::new(model, self.settings, self.rng)?
        })
    }

    /// The run after this many epochs, with the optimiser's state at that time.
    ///
    /// # Errors
    /// What is wrong with bytes that are not a record of this optimiser.
    pub(super) fn resumed_at(self, epoch: usize, optimizer: &[u8]) -> Result<Self, String> {
        let optimizer = self.optimizer.resumed(optimizer, &self.numbers, epoch)?;
        Ok(Self {
            optimizer,
            epoch,
            ..self
        })
    }

    /// Epochs done.
    pub fn epoch(&self) -> usize {
        self.epoch
    }

    /// The settings of the run.
    pub fn settings(&self) -> &FitSettings {
        &self.settings
    }

    /// The records so far, oldest first.
    pub fn history(&self) -> &[Record] {
        &self.history
    }

    fn run_epoch(&mut self, batches: &Batches) -> Result<Epoch, TrainError> {
        let Batching::Mini { size } = self.settings.batching else {
            return self.step(&batches.training);
        };
        let segments = batches.segments;
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.shuffle(&mut self.rng);
        let device = self.model.device();
        let mut mean = Epoch::default();
        for chosen in order.chunks(size.get()) {
            let part = self.step(&self.objective.batch(segments, chosen, &device))?;
            let share = chosen.len() as f64 / order.len() as f64;
            mean.loss += share * part.loss;
            mean.error += share * part.error;
        }
        Ok(mean)
    }

    /// One step of the optimiser on one batch.
    fn step(&mut self, batch: &Batch) -> Result<Epoch, TrainError> {
        let (model, weights) = (&self.model, self.weights());
        let (loss, parts) = (self.objective).weighted_loss(model, &self.numbers, batch, weights);
        let total = self.total(parts)?;
        // It is not tracked if all learning rates are zero.
        if loss.is_tracked() {
            let stepped = (self.optimizer).step(self.numbers.clone(), loss.backward());
            self.numbers = stepped.within_bounds(model);
        }
        Ok(Epoch {
            loss: total,
            error: parts[0],
        })
    }

    /// Evaluates the current model on all training segments and on validation.
    fn record(&mut self, batches: &Batches) -> Result<(), TrainError> {
        let model = self.model();
        let evaluate = |batch| self.objective.evaluate(&model, batch);
        let parts = evaluate(&batches.evaluation);
        let (loss, [error, residual_norm]) = (self.total(parts)?, parts);
        let validation = batches
            .validation
            .as_ref()
            .map(|batch| match evaluate(batch)[0] {
                error if error.is_finite() => error,
                _ => f64::INFINITY,
            });
        let weights = model.weights();
        self.history.push(Record {
            epoch: self.epoch,
            loss,
            error,
            residual_norm,
            validation,
            penalty_weight: self.penalty_weight,
            parameters: weights.parameters.clone(),
        });
        if let Some(validation) = validation
            && self
                .best
                .as_ref()
                .is_none_or(|best| validation < best.validation)
        {
            self.best = Some(Best {
                epoch: self.epoch,
                validation,
                weights,
            });
        }
        Ok(())
    }

    fn weights(&self) -> [f64; 2] {
        let penalty = self.settings.penalty;
        penalty.weights(self.penalty_weight, self.model.structure().has_residual)
    }

    /// The minimised loss.
    fn total(&self, loss: [f64; 2]) -> Result<f64, TrainError> {
        let weights = self.weights();
        let total = loss[0] * weights[0] + loss[1] * weights[1];
        if total.is_finite() {
            return Ok(total);
        }
        let named = self.model().parameters().into_iter();
        let list: Vec<String> = named.map(|(name, v)| format!("{name} = {v:.6}")).collect();
        Err(TrainError::Diverged {
            epoch: self.epoch,
            loss: total,
            parameters: if list.is_empty() {
                "no physical parameters".to_owned()
            } else {
                list.join(", ")
            },
        })
    }
}
