use std::ops::Range;

use nalgebra::DMatrix;

use super::eigen::eigen;
use super::outcome::Fit;
use super::values::Values;
use crate::model::Dynamics;

/// Which combinations of the free parameters the logs determine: the practical identifiability of the model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Identifiability {
    /// Number of free parameters.
    pub free: usize,
    /// Number of independent combinations that are determined.
    pub determined: usize,
    /// Undetermined combinations: for each, its parameters and their relative weights. Changing them together by these
    /// shares of their magnitudes changes no prediction.
    pub undetermined: Vec<Vec<(String, f64)>>,
    /// Parameters to hold so that all others are determined, as indices among all parameters of the model.
    pub hold: Vec<usize>,
}

/// A combination is undetermined if its standard deviation, relative to the parameters' magnitudes, is larger than this:
/// its 95 % interval then extends to seven times its value.
const LOOSE: f64 = 3.0;
/// It is also undetermined if its eigenvalue is smaller than this share of the largest one, which is rounding.
const ROUNDING: f64 = 1e-11;
/// Holding a parameter with a smaller share of the undetermined directions would determine none of them.
const NEGLIGIBLE: f64 = 1e-3;
/// Parameters with a smaller weight in a combination are not reported.
const NAMED: f64 = 0.1;

/// The verdict on a fit's free parameters at the values found, from the eigenvalues of its information matrix in relative
/// units. The parameters `free` are never held.
pub fn identifiability(
    dynamics: &Dynamics,
    free: &Range<usize>,
    found: &Values,
    fit: &Fit,
) -> Identifiability {
    let information = relative_information(dynamics, found, fit);
    let loose = loose_directions(&information);
    let name = |i: usize| dynamics.parameters[fit.columns[i].parameter].name.clone();
    let undetermined = loose
        .iter()
        .map(|direction| {
            let parts = direction
                .iter()
                .enumerate()
                .filter(|(_, w)| w.abs() > NAMED);
            parts.map(|(i, w)| (name(i), *w)).collect()
        })
        .collect();
    Identifiability {
        free: fit.columns.len(),
        determined: fit.columns.len() - loose.len(),
        undetermined,
        hold: hold(&information, fit, free),
    }
}

/// Hold the parameter with the largest weight in the undetermined directions, one after the other, until none is left that
/// may be held.
fn hold(information: &DMatrix<f64>, fit: &Fit, free: &Range<usize>) -> Vec<usize> {
    let mut left: Vec<usize> = (0..fit.columns.len()).collect();
    let mut hold = Vec::new();
    loop {
        let part = information.select_rows(&left).select_columns(&left);
        let loose = loose_directions(&part);
        let share = |i: usize| {
            loose
                .iter()
                .map(|direction| direction[i].powi(2))
                .sum::<f64>()
        };
        // Of equal shares the later parameter is held: files name the leading ones first.
        let Some(most) = (0..left.len())
            .filter(|&i| !free.contains(&fit.columns[left[i]].parameter) && share(i) > NEGLIGIBLE)
            .max_by(|&a, &b| share(a).total_cmp(&share(b)))
        else {
            return hold;
        };
        hold.push(fit.columns[left.remove(most)].parameter);
    }
}

fn relative_information(dynamics: &Dynamics, found: &Values, fit: &Fit) -> DMatrix<f64> {
    let all = fit.equations();
    let magnitude = |i: usize| {
        let scale = dynamics.parameters[fit.columns[i].parameter].scale;
        found.get(fit.columns[i]).abs().max(1e-3 * scale)
    };
    let size = fit.columns.len();
    DMatrix::from_fn(size, size, |i, j| {
        all.hessian[(i, j)] * magnitude(i) * magnitude(j)
    })
}

fn loose_directions(information: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let size = information.nrows();
    let Some(eigen) = eigen(information.clone()) else {
        // What is not finite tells nothing.
        let axis = |i: usize| (0..size).map(|k| f64::from(u8::from(k == i))).collect();
        return (0..size).map(axis).collect();
    };
    let best = eigen.eigenvalues.max();
    let is_loose = |value: f64| value <= ROUNDING * best || value < 1.0 / (LOOSE * LOOSE);
    (0..size)
        .filter(|&i| is_loose(eigen.eigenvalues[i]))
        .map(|i| eigen.eigenvectors.column(i).iter().copied().collect())
        .collect()
}
