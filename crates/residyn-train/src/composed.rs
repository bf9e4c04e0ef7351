//! The loss as a composition of Burn's operations, one row of the batch in each entry of a tensor: the reference of the
//! fused loss, and the version that runs on devices other than the processor.

use burn::tensor::Tensor;

use super::{Columns, HybridModel};
use residyn_core::sim::Integrator;

/// Below this size a residual counts as absent: it keeps the slope of the norm finite at zero, where every residual
/// begins.
pub(super) const NORM_FLOOR: f64 = 1e-6;

/// E and ||F_r||, `[2]`.
pub(super) fn loss(
    model: &HybridModel,
    batch: &Columns,
    integrator: Integrator,
    scale: &[f64],
) -> Tensor<1> {
    let model = model.unpack();
    let mut state = batch.states[0].clone();
    let (mut errors, mut residuals) = (Vec::new(), Vec::new());
    for (k, input) in batch.inputs.iter().enumerate() {
        let step = model.step(integrator, &state, input, &batch.time[k], &batch.dt[k]);
        errors.push(squared_error(&step.state, &batch.states[k + 1], scale).sum());
        residuals.extend(step.residual.map(|residual| residual.square().sum()));
        state = step.state;
    }
    let count = (batch.size * batch.inputs.len()) as f64;
    let error = mean(errors, count).expect("segments have steps");
    let norm = mean(residuals, count).map_or_else(
        || error.zeros_like(),
        |square| (square + NORM_FLOOR * NORM_FLOOR).sqrt(),
    );
    Tensor::cat(vec![error, norm], 0)
}

/// The squared norm of the error, `[batch]`.
fn squared_error(found: &[Tensor<1>], wanted: &[Tensor<1>], scale: &[f64]) -> Tensor<1> {
    (found.iter().zip(wanted).zip(scale))
        .map(|((found, wanted), scale)| ((found.clone() - wanted.clone()) / *scale).square())
        .reduce(|sum, part| sum + part)
        .expect("models have states")
}

fn mean(parts: Vec<Tensor<1>>, count: f64) -> Option<Tensor<1>> {
    let sum = parts.into_iter().reduce(|sum, part| sum + part)?;
    Some(sum / count)
}
