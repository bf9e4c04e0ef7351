use burn::tensor::Tensor;

use super::{Batch, TrainError};
use crate::model::{HybridModel, Integrator};

/// The number below which a residual counts as absent: it keeps the slope of the norm finite at zero,
/// where every residual starts.
const NORM_FLOOR: f64 = 1e-6;

/// The units in which errors of the states are measured; by default 1 for each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StateScale(Option<Vec<f64>>);

/// The two parts of the loss.
#[derive(Debug, Clone)]
pub struct Loss {
    /// E, `[1]`: the mean over all segments and steps of ||(s' - s_hat') / scale||_2^2, where s_hat' is
    /// reached from the segment's first state by the unrolled integrator.
    pub error: Tensor<1>,
    /// ||F_r||, `[1]`: the root of the mean over all segments and steps of the squared Euclidean norm of
    /// F_r at the step's start; none in a model without a residual.
    ///
    /// This is the norm of F_r as a function, under the distribution of the data. The mean of the norms
    /// would be another choice; it treats rows one by one and pulls small residuals to zero as hard as
    /// large ones, so that an effect felt in few rows would vanish first.
    pub residual_norm: Option<Tensor<1>>,
}

impl StateScale {
    /// A scale for each of `2n` states.
    ///
    /// # Errors
    /// Another count, or a number that is not finite and above zero.
    pub fn new(scale: Option<&[f64]>, joints: usize) -> Result<Self, TrainError> {
        match scale {
            Some(scale)
                if scale.len() != 2 * joints
                    || !scale.iter().all(|s| s.is_finite() && *s > 0.0) =>
            {
                Err(TrainError::ErrorScale {
                    states: 2 * joints,
                    scale: scale.to_vec(),
                })
            }
            _ => Ok(Self(scale.map(<[f64]>::to_vec))),
        }
    }

    fn apply(&self, state: usize, difference: Tensor<1>) -> Tensor<1> {
        match &self.0 {
            Some(scale) => difference / scale[state],
            None => difference,
        }
    }
}

/// The loss of a model on a batch, through the unrolled integrator.
pub fn loss(
    model: &HybridModel,
    batch: &Batch,
    integrator: Integrator,
    scale: &StateScale,
) -> Loss {
    let model = model.prepare();
    let mut state = batch.states[0].clone();
    let (mut errors, mut residuals) = (Vec::new(), Vec::new());
    for (k, input) in batch.inputs.iter().enumerate() {
        let step = integrator.step(&model, &state, input, &batch.time[k], &batch.dt[k]);
        errors.push(squared_error(&step.state, &batch.states[k + 1], scale));
        residuals.extend(step.residual.map(|r| r.square().sum() / batch.size as f64));
        state = step.state;
    }
    let steps = batch.inputs.len() as f64;
    Loss {
        error: mean(errors, steps).expect("segments have steps"),
        residual_norm: mean(residuals, steps)
            .map(|square| (square + NORM_FLOOR * NORM_FLOOR).sqrt()),
    }
}

/// Mean over the batch of the squared norm of the error, `[1]`.
fn squared_error(found: &[Tensor<1>], wanted: &[Tensor<1>], scale: &StateScale) -> Tensor<1> {
    (found.iter().zip(wanted).enumerate())
        .map(|(k, (found, wanted))| scale.apply(k, found.clone() - wanted.clone()).square())
        .reduce(|sum, part| sum + part)
        .expect("models have states")
        .mean()
}

fn mean(parts: Vec<Tensor<1>>, count: f64) -> Option<Tensor<1>> {
    let sum = parts.into_iter().reduce(|sum, part| sum + part)?;
    Some(if count == 1.0 { sum } else { sum / count })
}
