//! The loss as a composition of Burn's operations, one row of the batch in each entry of a tensor.

use burn::tensor::Tensor;

use super::{Columns, Unpacked};
use crate::sim::Integrator;

/// Below this size a residual counts as absent: it keeps the slope of the norm finite at zero, where every residual
/// begins.
pub(super) const NORM_FLOOR: f64 = 1e-6;

/// E and ||F_r|| of each of so many models, `[models]`. The batch has the same number of rows for each, one model's
/// after the other's.
pub(super) fn of_each(
    model: &Unpacked,
    models: usize,
    batch: &Columns,
    integrator: Integrator,
    scale: &[f64],
) -> [Tensor<1>; 2] {
    let rows = batch.size / models;
    let mut state = batch.states[0].clone();
    let (mut errors, mut residuals) = (Vec::new(), Vec::new());
    for (k, input) in batch.inputs.iter().enumerate() {
        let step = model.step(integrator, &state, input, &batch.time[k], &batch.dt[k]);
        let error = squared_error(&step.state, &batch.states[k + 1], scale);
        errors.push(mean_of_each(error, models, rows));
        residuals.extend((step.residual).map(|r| mean_of_each(r.square(), models, rows)));
        state = step.state;
    }
    let steps = batch.inputs.len() as f64;
    let error = mean(errors, steps).expect("segments have steps");
    let norm = mean(residuals, steps).map_or_else(
        || error.zeros_like(),
        |square| (square + NORM_FLOOR * NORM_FLOOR).sqrt(),
    );
    [error, norm]
}

/// The squared norm of the error, `[batch]`.
fn squared_error(found: &[Tensor<1>], wanted: &[Tensor<1>], scale: &[f64]) -> Tensor<1> {
    (found.iter().zip(wanted).zip(scale))
        .map(|((found, wanted), scale)| ((found.clone() - wanted.clone()) / *scale).square())
        .reduce(|sum, part| sum + part)
        .expect("models have states")
}

/// The sum of each model's entries, divided by its rows, `[models]`.
fn mean_of_each<const D: usize>(entries: Tensor<D>, models: usize, rows: usize) -> Tensor<1> {
    let count = entries.shape().num_elements();
    let sums = entries.reshape([models, count / models]).sum_dim(1);
    sums.reshape([models]) / rows as f64
}

fn mean(parts: Vec<Tensor<1>>, count: f64) -> Option<Tensor<1>> {
    let sum = parts.into_iter().reduce(|sum, part| sum + part)?;
    Some(if count == 1.0 { sum } else { sum / count })
}
