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
/// It is also undetermined if its information is smaller than this share of what its parameters have, each of them alone:
/// then it is rounding.
const ROUNDING: f64 = 1e-11;
/// Holding a parameter with a smaller share of the undetermined directions would determine none of them.
const NEGLIGIBLE: f64 = 1e-3;
/// Parameters with a smaller weight in a combination are not reported.
const NAMED: f64 = 0.1;

/// The verdict on a fit's free parameters at the values found, from the eigenvalues of its information matrix in relative
/// units. Of the parameters, those of which `may_be_held` is true are.
pub fn identifiability(
    dynamics: &Dynamics,
    may_be_held: impl Fn(usize) -> bool,
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
    let (hold, still_loose) = hold(&information, fit, may_be_held);
    Identifiability {
        free: fit.columns.len(),
        determined: fit.columns.len() - hold.len() - still_loose,
        undetermined,
        hold,
    }
}

/// Hold the parameter with the largest weight in the undetermined directions, one after the other, while that leaves fewer
/// of them; and how many are left.
fn hold(
    information: &DMatrix<f64>,
    fit: &Fit,
    may_be_held: impl Fn(usize) -> bool,
) -> (Vec<usize>, usize) {
    let part = |of: &[usize]| loose_directions(&information.select_rows(of).select_columns(of));
    let mut left: Vec<usize> = (0..fit.columns.len()).collect();
    let mut loose = part(&left);
    let mut hold = Vec::new();
    loop {
        let share = |i: &usize| -> f64 { loose.iter().map(|v| v[*i].powi(2)).sum() };
        let is_candidate = |i: &usize| may_be_held(fit.columns[left[*i]].parameter);
        let mut candidates: Vec<usize> = (0..left.len()).filter(is_candidate).collect();
        candidates.retain(|i| share(i) > NEGLIGIBLE);
        // Of equal shares the later parameter is held: files name the leading ones first.
        candidates.sort_by(|a, b| share(b).total_cmp(&share(a)).then(b.cmp(a)));
        let without = |i: usize| {
            let others: Vec<usize> = [&left[..i], &left[i + 1..]].concat();
            let fewer = part(&others);
            (fewer.len() < loose.len()).then_some((left[i], others, fewer))
        };
        let Some((held, others, fewer)) = candidates.into_iter().find_map(without) else {
            return (hold, loose.len());
        };
        hold.push(fit.columns[held].parameter);
        (left, loose) = (others, fewer);
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
    // The information of each parameter is rounded by itself.
    let rounding = |direction: &[f64]| {
        let parts = direction.iter().enumerate();
        let sizes = parts.map(|(i, w)| w.abs() * information[(i, i)].max(0.0).sqrt());
        ROUNDING * sizes.sum::<f64>().powi(2)
    };
    let directions = eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues);
    directions
        .map(|(direction, value)| (direction.iter().copied().collect::<Vec<f64>>(), *value))
        .filter(|(direction, value)| {
            *value < 1.0 / (LOOSE * LOOSE) || *value <= rounding(direction)
        })
        .map(|(direction, _)| direction)
        .collect()
}
