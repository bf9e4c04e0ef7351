use std::sync::Arc;

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::fused::{self, Problem, Workers};
use super::hybrid::{to_f64, vector};
use super::packed::Packed;
use super::{Backend, Blocks, Columns, HybridModel, Segments, TrainError, composed};
use residyn_core::model;
use residyn_core::sim::Integrator;

/// The objective of a fit: how predictions are made, and the units of their errors.
#[derive(Debug)]
pub struct Objective {
    integrator: Integrator,
    /// The size of a unit error in each state.
    scale: Vec<f64>,
    /// 1 / scale.
    precision: Arc<[f32]>,
    implementation: Implementation,
    workers: Arc<Workers>,
}

/// The implementation that evaluates losses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Implementation {
    /// One operation for rollout, networks and penalty, on the processor; other devices compose the loss.
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

impl Objective {
    /// Errors in units of `error_scale`, one for each of the `2n` states; 1 for each by default.
    ///
    /// # Errors
    /// A wrong count, or a number that is not finite and above zero.
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

    /// The same objective with losses composed of Burn's operations on every device: the reference for the fused loss,
    /// and many times slower.
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

    /// The threads that evaluate its losses.
    pub(super) fn workers(&self) -> Arc<Workers> {
        self.workers.clone()
    }

    /// E and ||F_r|| of a model on a batch, a tensor `[2]`, with derivatives if the model is on a device that takes
    /// them. It is part of Burn's graph like any other tensor, so custom terms can be added to it.
    ///
    /// E: the mean over all segments and steps of ||(s' - s_hat') / scale||_2^2, where s_hat' is reached from the segment's
    /// first state by the unrolled integrator.
    ///
    /// ||F_r||: the root of the mean over all segments and steps of the squared Euclidean norm of F_r at the step's start; 0
    /// in a model without a residual. This is the norm of F_r as a function, under the distribution of the data. The
    /// mean of the norms would penalise rows one by one and pull small residuals to zero as hard as large ones, so that
    /// an effect in few rows would vanish first.
    pub fn loss(&self, model: &HybridModel, batch: &Batch) -> Tensor<1> {
        match batch {
            Batch::Columns(columns) => composed::loss(model, columns, self.integrator, &self.scale),
            Batch::Blocks(blocks) => {
                let each = [[1.0, 0.0], [0.0, 1.0]];
                self.fused_loss(model, model.flat(), blocks, &each).0
            }
        }
    }

    /// The weighted sum of E and ||F_r|| for a model with other numbers, `[1]`; and the two alone.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn weighted_loss(
        &self,
        model: &HybridModel,
        packed: &Packed,
        batch: &Batch,
        weights: [f64; 2],
    ) -> (Tensor<1>, [f64; 2]) {
        match batch {
            Batch::Columns(_) => {
                let loss = self.loss(&packed.viewed(model), batch);
                let parts = numbers(loss.clone());
                let weights = vector(&weights, &loss.device());
                ((loss * weights).sum(), parts)
            }
            Batch::Blocks(blocks) => {
                let weights = weights.map(|weight| weight as f32);
                self.fused_loss(model, packed.flat(), blocks, &[weights])
            }
        }
    }

    fn fused_loss(
        &self,
        model: &HybridModel,
        numbers: Tensor<1>,
        blocks: &Arc<Blocks>,
        sums: &[[f32; 2]],
    ) -> (Tensor<1>, [f64; 2]) {
        let structure = model.structure();
        let problem = Problem::new(structure, blocks, self.integrator, &self.precision);
        fused::loss(numbers, problem, self.workers.clone(), sums)
    }

    /// E and ||F_r|| as numbers, without derivatives.
    pub fn evaluate(&self, model: &HybridModel, batch: &Batch) -> [f64; 2] {
        numbers(self.loss(&model.valid(), batch))
    }
}

/// The copy has its own threads.
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

/// E and ||F_r|| of a loss.
pub(super) fn numbers(loss: Tensor<1>) -> [f64; 2] {
    let parts = to_f64(loss).try_into();
    parts.expect("a loss has two parts")
}
