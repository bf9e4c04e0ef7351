use std::ops::ControlFlow;

use burn::module::Module;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::optimizer::Stepper;
use super::{Batch, Batching, Best, FitSettings, Loss, Objective, Record, Segments, TrainError};
use crate::train::HybridModel;

/// A training run: a value that can be held, saved ([`save`](super::save)), loaded and continued. Where
/// it was interrupted does not change its result by a bit on the same backend and machine.
#[derive(Clone)]
pub struct Training {
    pub(super) model: HybridModel,
    pub(super) settings: FitSettings,
    pub(super) optimizer: Stepper<1>,
    pub(super) rng: ChaCha8Rng,
    pub(super) epoch: usize,
    pub(super) penalty_weight: f64,
    pub(super) history: Vec<Record>,
    pub(super) best: Option<Best>,
    objective: Objective,
}

/// What an observer sees after each epoch.
pub struct Progress<'a> {
    /// Epochs done.
    pub epoch: usize,
    /// Epochs of the whole run.
    pub epochs: usize,
    /// What was minimised in this epoch, mean over its batches, before their steps.
    pub loss: f64,
    /// The prediction error in it.
    pub error: f64,
    /// The run itself, for its history and to save it.
    pub training: &'a Training,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// All epochs are done.
    Finished,
    /// The observer asked to stop; the run can go on.
    Stopped,
}

/// What a run is done with.
struct Material<'a> {
    segments: &'a Segments,
    /// All of them, with gradients.
    trained: Batch,
    /// The same without.
    judged: Batch,
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
        Ok(Self {
            objective: Objective::new(
                settings.integrator,
                settings.error_scale.as_deref(),
                model.joints(),
            )?,
            optimizer: Stepper::new(model.frame(), &settings),
            epoch: 0,
            penalty_weight: settings.penalty.initial(),
            history: Vec::new(),
            best: None,
            model,
            settings,
            rng,
        })
    }

    /// The same run with its losses composed of Burn's operations, see [`Objective::composed`].
    #[must_use]
    pub fn composed(self) -> Self {
        Self {
            objective: self.objective.composed(),
            ..self
        }
    }

    /// Train until all epochs are done or `observer`, called after each, breaks off. Call it again to
    /// go on. With `validation` the best model by its error is kept, the one before training included.
    ///
    /// # Errors
    /// Segments that do not fit the model, or a loss that is no longer finite: numbers are never repaired.
    pub fn run(
        &mut self,
        segments: &Segments,
        validation: Option<&Segments>,
        observer: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Ended, TrainError> {
        segments.check_for(self.model.frame(), "training")?;
        let device = self.model.device();
        let plain = device.clone().without_autodiff();
        if let Some(validation) = validation {
            validation.check_for(self.model.frame(), "validation")?;
        }
        let material = Material {
            segments,
            trained: self.objective.all(segments, &device),
            judged: self.objective.all(segments, &plain),
            validation: validation.map(|segments| self.objective.all(segments, &plain)),
        };
        let workers = self.objective.workers();
        workers.helped(|| self.run_epochs(&material, observer))
    }

    fn run_epochs(
        &mut self,
        material: &Material,
        observer: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Ended, TrainError> {
        if self.history.is_empty() {
            self.record(material)?;
        }
        while self.epoch < self.settings.epochs {
            self.optimizer.anneal(self.settings.share_in(self.epoch));
            let Epoch { loss, error } = self.run_epoch(material)?;
            self.epoch += 1;
            self.penalty_weight = self.settings.penalty.next(self.penalty_weight, error);
            let every = self.settings.record_every.get();
            if self.epoch.is_multiple_of(every) || self.epoch == self.settings.epochs {
                self.record(material)?;
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

    /// The model as it is now.
    pub fn model(&self) -> &HybridModel {
        &self.model
    }

    /// The model to use: the best by validation error, or the present one where there is no validation.
    ///
    /// # Errors
    /// None for a run made or loaded by this module.
    pub fn result(&self) -> Result<HybridModel, TrainError> {
        match &self.best {
            Some(best) => Ok(self.model.with_weights(&best.weights)?),
            None => Ok(self.model.clone()),
        }
    }

    /// Epochs done.
    pub fn epoch(&self) -> usize {
        self.epoch
    }

    /// The settings of the run.
    pub fn settings(&self) -> &FitSettings {
        &self.settings
    }

    /// What was recorded so far, oldest first.
    pub fn history(&self) -> &[Record] {
        &self.history
    }

    /// The best model by validation error, where there is validation.
    pub fn best(&self) -> Option<&Best> {
        self.best.as_ref()
    }

    fn run_epoch(&mut self, material: &Material) -> Result<Epoch, TrainError> {
        let Batching::Mini { size } = self.settings.batching else {
            return self.step(&material.trained);
        };
        let segments = material.segments;
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
        let loss = self.objective.loss(&self.model, batch);
        let weights = self.weights();
        let (total, [error, _]) = self.total(&loss, weights)?;
        let gradients = loss.weighted(weights).backward();
        let stepped = self.optimizer.step(self.model.tensors(), gradients);
        self.model = self.model.with_tensors(stepped).project();
        Ok(Epoch { loss: total, error })
    }

    /// Judge the present model on all training segments and on validation.
    fn record(&mut self, material: &Material) -> Result<(), TrainError> {
        let model = self.model.clone().valid();
        let judge = |batch| self.objective.loss(&model, batch);
        let (loss, [error, residual_norm]) =
            self.total(&judge(&material.judged), self.weights())?;
        let validation =
            material
                .validation
                .as_ref()
                .map(|batch| match judge(batch).numbers()[0] {
                    error if error.is_finite() => error,
                    _ => f64::INFINITY,
                });
        let weights = self.model.weights();
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
        penalty.weights(self.penalty_weight, self.model.frame().has_residual)
    }

    /// What is minimised, and its parts before they are weighted.
    fn total(&self, loss: &Loss, weights: [f64; 2]) -> Result<(f64, [f64; 2]), TrainError> {
        let parts = loss.numbers();
        let total = parts[0] * weights[0] + parts[1] * weights[1];
        if total.is_finite() {
            return Ok((total, parts));
        }
        let named = self.model.parameters().into_iter();
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
