use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};

use super::{Batch, Columns, HybridModel, Prepared, Segments, TrainError, composed, fused};
use crate::sim::Integrator;

/// The number below which a residual counts as absent: it keeps the slope of the norm finite at zero,
/// where every residual starts.
pub(super) const NORM_FLOOR: f64 = 1e-6;

/// What models are judged by: the way their predictions are made and the units of their errors.
#[derive(Debug)]
pub struct Objective {
    integrator: Integrator,
    /// What an error of 1 is in each state.
    scale: Vec<f64>,
    /// 1 / scale.
    precision: Arc<[f32]>,
    workers: Arc<fused::Workers>,
    /// Whether losses are composed of Burn's operations on the processor, too.
    is_composed: bool,
}

/// The two parts of the loss, `[2]`.
///
/// E: the mean over all segments and steps of ||(s' - s_hat') / scale||_2^2, where s_hat' is reached from the segment's
/// first state by the unrolled integrator.
///
/// ||F_r||: the root of the mean over all segments and steps of the squared Euclidean norm of F_r at the step's start; 0
/// in a model without a residual. This is the norm of F_r as a function, under the distribution of the data. The mean of
/// the norms would be another choice; it treats rows one by one and pulls small residuals to zero as hard as large
/// ones, so that an effect felt in few rows would vanish first.
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
        #[allow(clippy::cast_possible_truncation)] // training runs in f32
        let precision = scale.iter().map(|scale| (1.0 / scale) as f32);
        Ok(Self {
            integrator,
            precision: precision.collect(),
            scale,
            workers: Arc::default(),
            is_composed: false,
        })
    }

    /// The same with losses composed of Burn's operations wherever they are evaluated: the reference of the fused loss,
    /// and many times slower.
    #[must_use]
    pub fn composed(self) -> Self {
        Self {
            is_composed: true,
            ..self
        }
    }

    /// The chosen segments, as [`Objective::loss`] takes them on a device.
    pub(super) fn batch(&self, segments: &Segments, chosen: &[usize], device: &Device) -> Batch {
        if self.is_composed {
            Batch::Columns(segments.columns(chosen, device))
        } else {
            segments.batch(chosen, device)
        }
    }

    /// All segments, as [`Objective::loss`] takes them on a device.
    pub(super) fn all(&self, segments: &Segments, device: &Device) -> Batch {
        self.batch(segments, &(0..segments.len()).collect::<Vec<_>>(), device)
    }

    /// The threads for its losses.
    pub(super) fn workers(&self) -> Arc<fused::Workers> {
        self.workers.clone()
    }

    /// The loss of a model on a batch, through the unrolled integrator.
    pub fn loss(&self, model: &HybridModel, batch: &Batch) -> Loss {
        Loss(match batch {
            Batch::Columns(columns) => composed::loss(model, columns, self.integrator, &self.scale),
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
            workers: Arc::default(),
            is_composed: self.is_composed,
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
        #[allow(clippy::cast_possible_truncation)] // training runs in f32
        let weights = TensorData::from(weights.map(|weight| weight as f32));
        let weights = Tensor::from_data(weights, &self.0.device());
        self.0 * weights
    }
}
