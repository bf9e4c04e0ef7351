//! The loss as a composition of Burn's operations, one row of the batch in each entry of a tensor.

use burn::tensor::Tensor;

use super::Columns;
use super::loss::NORM_FLOOR;
use crate::model::{HybridModel, Integrator};

/// E and ||F_r||, `[2]`.
pub(super) fn loss(
    model: &HybridModel,
    batch: &Columns,
    integrator: Integrator,
    scale: &[f64],
) -> Tensor<1> {
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
    let error = mean(errors, steps).expect("segments have steps");
    let norm = mean(residuals, steps).map_or_else(
        || error.zeros_like(),
        |square| (square + NORM_FLOOR * NORM_FLOOR).sqrt(),
    );
    Tensor::cat(vec![error, norm], 0)
}

/// Mean over the batch of the squared norm of the error, `[1]`.
fn squared_error(found: &[Tensor<1>], wanted: &[Tensor<1>], scale: &[f64]) -> Tensor<1> {
    (found.iter().zip(wanted).zip(scale))
        .map(|((found, wanted), scale)| ((found.clone() - wanted.clone()) / *scale).square())
        .reduce(|sum, part| sum + part)
        .expect("models have states")
        .mean()
}

fn mean(parts: Vec<Tensor<1>>, count: f64) -> Option<Tensor<1>> {
    let sum = parts.into_iter().reduce(|sum, part| sum + part)?;
    Some(if count == 1.0 { sum } else { sum / count })
}
