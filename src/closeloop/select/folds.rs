use nalgebra::{DMatrix, DVector};

use crate::closeloop::study::Study;
use crate::identify::{Fit, blocks, with_unit_diagonal};

/// For each window the fold that it is left out with: its trajectory or, where there are few, a stretch of it.
fn folds(study: &Study<'_>) -> Vec<usize> {
    let shooting = &study.shooting;
    if shooting.logs.len() >= study.settings.select.whole_logs {
        shooting.windows.iter().map(|window| window.log).collect()
    } else {
        blocks(shooting)
    }
}

/// The loss on each fold of a study's windows, with the parameters that a fit to the other folds would give. The fit is not
/// repeated: each window's loss is taken as quadratic around the joint optimum, where leaving out a fold moves the
/// parameters by (H - `H_k`)^-1 `g_k`. A log that is left out whole keeps the values that it has of its own, since no other
/// log determines them.
pub fn left_out_losses(study: &Study<'_>, fit: &Fit) -> Vec<f64> {
    let parts = fit.equations_by(&folds(study));
    let mut all = fit.zero_equations();
    for part in &parts {
        all.gradient += &part.gradient;
        all.hessian += &part.hessian;
    }
    parts
        .iter()
        .map(|part| {
            // At a bound the gradients do not sum to zero; what the bound carries must not move the rest.
            let own = &part.gradient - &all.gradient * share(&part.hessian, &all.hessian);
            let step = free_step(&(&all.hessian - &part.hessian), &own);
            part.cost + part.gradient.dot(&step) + 0.5 * step.dot(&(&part.hessian * &step))
        })
        .collect()
}

/// The part of the information that one fold holds.
fn share(part: &DMatrix<f64>, all: &DMatrix<f64>) -> f64 {
    part.trace() / all.trace().max(f64::MIN_POSITIVE)
}

fn free_step(matrix: &DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    if right.is_empty() {
        return right.clone();
    }
    // Relative units, so that a parameter in N m s/rad weighs as much as one in 1/s^2.
    let (scaled, scale) = with_unit_diagonal(matrix);
    let inverse = scaled
        .pseudo_inverse(1e-10)
        .unwrap_or_else(|_| DMatrix::zeros(right.len(), right.len()));
    let step = inverse * right.component_mul(&scale);
    step.component_mul(&scale)
}
