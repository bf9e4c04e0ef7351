use std::sync::Arc;

use burn::tensor::{Device, Tensor};

use super::composed;
use super::fused::{Evaluation, Problem, Workers};
use super::hybrid::{Numbers, to_f32, to_f64, vector};
use super::{Backend, Blocks, Columns, HybridModel, Segments, TrainError, Unpacked};
use crate::model;
use crate::sim::Integrator;

/// What a model is fitted to: the way its predictions are made, and the units of their errors.
#[derive(Debug)]
pub struct Objective {
    integrator: Integrator,
    /// What an error of 1 is in each state.
    scale: Vec<f64>,
    /// 1 / scale.
    precision: Arc<[f32]>,
    implementation: Implementation,
    workers: Arc<Workers>,
}

/// What evaluates losses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Implementation {
    /// One pass over rollout, networks and penalty, on the processor; other devices compose the loss.
    Fused,
    /// Burn's operations on every device.
    Composed,
}

/// Segments ready for a loss of an [`Objective`].
#[derive(Debug, Clone)]
pub enum Batch {
    /// For Burn's operations.
    Columns(Columns),
    /// For the fused loss.
    Blocks(Arc<Blocks>),
}

/// A loss with its gradient.
#[derive(Debug, Clone)]
pub(super) struct Gradient {
    /// E and ||F_r||.
    pub loss: [f64; 2],
    /// Of their weighted sum, by the learnable numbers.
    pub by_numbers: Numbers,
}

impl Objective {
    /// Errors in the units of `error_scale`, one for each of `2n` states, or 1 for each.
    ///
    /// # Errors
    /// Another count, or a number that is not finite and above zero.
    pub fn new(
        integrator: Integrator,
        error_scale: Option<&[f64]>,
        joints: usize,
    ) -> Result<Self, TrainError> {
        let scale = error_scale.map_or_else(|| vec![1.0; 2 * joints], <[f64]>::to_vec);
        if scale.len() != 2 * joints || !scale.iter().all(|s| s.is_finite() && *s > 0.0) {
            return Err(TrainError::ErrorScale {
                states: 2 * joints,
                scale,
            });
        }
        let precision: Vec<f64> = scale.iter().map(|scale| 1.0 / scale).collect();
        Ok(Self {
            integrator,
            precision: model::to_f32(&precision).into(),
            scale,
            implementation: Implementation::Fused,
            workers: Arc::default(),
        })
    }

    /// The same with losses composed of Burn's operations on every device: the reference of the fused loss, and many
    /// times slower.
    #[must_use]
    pub fn composed(self) -> Self {
        Self {
            implementation: Implementation::Composed,
            ..self
        }
    }

    /// The chosen segments for losses on a device.
    pub fn batch(&self, segments: &Segments, chosen: &[usize], device: &Device) -> Batch {
        match self.implementation {
            Implementation::Fused if *device == Backend::NdArray.device() => {
                Batch::Blocks(Arc::new(segments.blocks(chosen)))
            }
            _ => Batch::Columns(segments.columns(chosen, device)),
        }
    }

    /// All segments for losses on a device.
    pub fn all(&self, segments: &Segments, device: &Device) -> Batch {
        self.batch(segments, &(0..segments.len()).collect::<Vec<_>>(), device)
    }

    /// The threads of its losses.
    pub(super) fn workers(&self) -> Arc<Workers> {
        self.workers.clone()
    }

    /// E and ||F_r|| of a model on a batch.
    ///
    /// E: the mean over all segments and steps of ||(s' - s_hat') / scale||_2^2, where s_hat' is reached from the segment's
    /// first state by the unrolled integrator.
    ///
    /// ||F_r||: the root of the mean over all segments and steps of the squared Euclidean norm of F_r at the step's start; 0
    /// in a model without a residual. This is the norm of F_r as a function, under the distribution of the data. The mean
    /// of the norms would treat rows one by one and pull small residuals to zero as hard as large ones, so that an effect
    /// in few rows would vanish first.
    pub fn loss(&self, model: &HybridModel, batch: &Batch) -> [f64; 2] {
        match batch {
            Batch::Columns(columns) => numbers(self.composed_loss(&model.unpack(), columns)),
            Batch::Blocks(blocks) => self.evaluation(model, blocks).loss.map(f64::from),
        }
    }

    /// The loss, and the gradient of the sum of its parts times `weights`. The model must be on a device with gradients.
    pub(super) fn gradient(
        &self,
        model: &HybridModel,
        batch: &Batch,
        weights: [f64; 2],
    ) -> Gradient {
        match batch {
            Batch::Columns(columns) => {
                let tensors = model.tensors().map(Tensor::require_grad);
                let loss = self.composed_loss(&model.unpack_tensors(&tensors), columns);
                let weights = vector(&weights, &loss.device());
                let mut gradients = (loss.clone() * weights).backward();
                let by_numbers = tensors.map(|tensor| {
                    let gradient = tensor.grad_remove(&mut gradients);
                    gradient.map_or_else(Vec::new, to_f32)
                });
                Gradient {
                    loss: numbers(loss),
                    by_numbers,
                }
            }
            Batch::Blocks(blocks) => {
                let evaluation = self.evaluation(model, blocks);
                Gradient {
                    loss: evaluation.loss.map(f64::from),
                    by_numbers: evaluation.derivative(weights),
                }
            }
        }
    }

    fn evaluation(&self, model: &HybridModel, blocks: &Arc<Blocks>) -> Evaluation {
        let structure = model.structure();
        let problem = Problem::new(structure, blocks, self.integrator, &self.precision);
        Evaluation::new(problem, &self.workers, model.numbers())
    }

    /// E and ||F_r||, `[2]`.
    fn composed_loss(&self, unpacked: &Unpacked, columns: &Columns) -> Tensor<1> {
        Tensor::cat(self.of_each(1, unpacked, columns).to_vec(), 0)
    }

    /// E and ||F_r|| of each of so many models, `[models]`. The batch has the same number of rows for each, one model's
    /// after the other's.
    pub(super) fn of_each(
        &self,
        models: usize,
        unpacked: &Unpacked,
        batch: &Columns,
    ) -> [Tensor<1>; 2] {
        composed::of_each(unpacked, models, batch, self.integrator, &self.scale)
    }
}

/// The copy has threads of its own.
impl Clone for Objective {
    fn clone(&self) -> Self {
        Self {
            integrator: self.integrator,
            scale: self.scale.clone(),
            precision: self.precision.clone(),
            implementation: self.implementation,
            workers: Arc::default(),
        }
    }
}

fn numbers(loss: Tensor<1>) -> [f64; 2] {
    let parts = to_f64(loss).try_into();
    parts.expect("a loss has two parts")
}
