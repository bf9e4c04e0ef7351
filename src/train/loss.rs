use std::sync::Arc;

use burn::tensor::{Device, Tensor};

use super::hybrid::vector;
use super::{Backend, Blocks, Columns, HybridModel, Prepared, Segments, TrainError};
use super::{composed, fused};
use crate::model::to_f32;
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
    workers: Arc<fused::Workers>,
}

/// What evaluates losses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Implementation {
    /// One operation for the whole loss, on the processor; devices without it compose the loss.
    Fused,
    /// Burn's operations on every device.
    Composed,
}

/// Segments ready for a loss of an [`Objective`].
#[derive(Debug, Clone)]
pub enum Batch {
    /// For Burn's operations.
    Columns(Columns),
    /// For the fused operation.
    Blocks(Arc<Blocks>),
}

/// The two parts of the loss, `[2]`.
///
/// E: the mean over all segments and steps of ||(s' - s_hat') / scale||_2^2, where s_hat' is reached from the segment's
/// first state by the unrolled integrator.
///
/// ||F_r||: the root of the mean over all segments and steps of the squared Euclidean norm of F_r at the step's start; 0
/// in a model without a residual. This is the norm of F_r as a function, under the distribution of the data. The mean of
/// the norms would treat rows one by one and pull small residuals to zero as hard as large ones, so that an effect in
/// few rows would vanish first.
#[derive(Debug, Clone)]
pub struct Loss(Tensor<1>);

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
            precision: to_f32(&precision).into(),
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
    pub(super) fn workers(&self) -> Arc<fused::Workers> {
        self.workers.clone()
    }

    /// The loss of a model on a batch, through the unrolled integrator.
    pub fn loss(&self, model: &HybridModel, batch: &Batch) -> Loss {
        Loss(match batch {
            Batch::Columns(columns) => {
                Tensor::cat(self.of_each(1, &model.prepare(), columns).to_vec(), 0)
            }
            Batch::Blocks(blocks) => fused::loss(
                model,
                blocks,
                self.integrator,
                &self.precision,
                &self.workers,
            ),
        })
    }

    /// E and ||F_r|| of each of so many models, `[models]`. The batch has the same number of rows for each, one model's
    /// after the other's.
    pub(super) fn of_each(
        &self,
        models: usize,
        prepared: &Prepared,
        batch: &Columns,
    ) -> [Tensor<1>; 2] {
        composed::of_each(prepared, models, batch, self.integrator, &self.scale)
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

impl Loss {
    /// E and ||F_r|| as numbers.
    pub fn numbers(&self) -> [f64; 2] {
        let data = self.0.to_data();
        let mut numbers = data.iter::<f32>().map(f64::from);
        [(); 2].map(|()| numbers.next().expect("a loss has two parts"))
    }

    /// The parts times their weights, `[2]`.
    pub fn weighted(self, weights: [f64; 2]) -> Tensor<1> {
        let weights = vector(&weights, &self.0.device());
        self.0 * weights
    }
}
