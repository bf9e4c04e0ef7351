use nalgebra::DMatrix;

use super::normal_equations::submatrix;
use super::outcome::Fit;
use super::values::Values;
use crate::decomposition::eigen;
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

/// A combination of free parameters that is undetermined, and one of them to hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Open {
    /// As in [`Identifiability::undetermined`].
    pub combination: Vec<(String, f64)>,
    /// Index among all parameters of the model.
    pub hold: usize,
}

impl Identifiability {
    /// Add a combination that was found undetermined later.
    pub fn leave(&mut self, open: Open) {
        if self.hold.contains(&open.hold) {
            return;
        }
        self.determined = self.determined.saturating_sub(1);
        self.undetermined.push(open.combination);
        self.hold.push(open.hold);
    }
}

/// A combination is undetermined if its standard deviation, relative to the parameters' magnitudes, is larger than this:
/// its 95 % interval then extends to seven times its value.
const LOOSE: f64 = 3.0;
/// It is also undetermined if its information is smaller than this share of the information that its parameters have
/// individually: then it is rounding error.
const ROUNDING: f64 = 1e-11;
/// Holding a parameter with a smaller share of the undetermined directions would determine none of them.
const NEGLIGIBLE: f64 = 1e-3;
/// Parameters with a smaller weight in a combination are not reported.
const NAMED: f64 = 0.1;

/// The verdict on a fit's free parameters at the values found, from the eigenvalues of its information matrix in
/// relative units. Parameters for which `readiness` gives a number may be held, the lowest numbers first.
pub fn identifiability(
    dynamics: &Dynamics,
    readiness: impl Fn(usize) -> Option<usize>,
    found: &Values,
    fit: &Fit,
) -> Identifiability {
    let information = relative_information(dynamics, found, fit);
    let loose = loose_directions(&information);
    let undetermined = loose
        .iter()
        .map(|direction| named(dynamics, fit, direction));
    let (hold, still_loose) = hold(&information, fit, readiness);
    Identifiability {
        free: fit.columns.len(),
        determined: fit.columns.len() - hold.len() - still_loose,
        undetermined: undetermined.collect(),
        hold,
    }
}

/// The parameters of a direction and their weights.
fn named(dynamics: &Dynamics, fit: &Fit, direction: &[f64]) -> Vec<(String, f64)> {
    let name = |i: usize| dynamics.parameters[fit.columns[i].parameter].name.clone();
    let parts = direction.iter().enumerate();
    let large = parts.filter(|(_, weight)| weight.abs() > NAMED);
    large.map(|(i, weight)| (name(i), *weight)).collect()
}

/// The combination of a fit's free parameters that varies most with the left-out block of the logs, if it varies too
/// much to be determined. Of its parameters with the lowest `readiness`, the one with the largest weight is to be held.
pub fn open(
    dynamics: &Dynamics,
    readiness: impl Fn(usize) -> Option<usize>,
    found: &Values,
    fit: &Fit,
    covariance: &DMatrix<f64>,
) -> Option<Open> {
    let size = fit.columns.len();
    if size == 0 {
        return None;
    }
    let magnitude = |i: usize| magnitude(dynamics, found, fit, i);
    let relative = DMatrix::from_fn(size, size, |i, j| {
        covariance[(i, j)] / (magnitude(i) * magnitude(j))
    });
    let eigen = eigen(relative)?;
    let widest = eigen.eigenvalues.imax();
    if eigen.eigenvalues[widest] <= LOOSE * LOOSE {
        return None;
    }
    let direction: Vec<f64> = eigen.eigenvectors.column(widest).iter().copied().collect();
    let held = (0..size)
        .filter(|i| direction[*i].powi(2) > NEGLIGIBLE)
        .filter_map(|i| Some((readiness(fit.columns[i].parameter)?, i)))
        .min_by(|(a, i), (b, j)| {
            let by_weight = direction[*j].abs().total_cmp(&direction[*i].abs());
            a.cmp(b).then(by_weight)
        })
        .map(|(_, i)| i)?;
    Some(Open {
        combination: named(dynamics, fit, &direction),
        hold: fit.columns[held].parameter,
    })
}

/// Hold the parameters with the largest weight in the undetermined directions, one after the other, while that leaves
/// fewer directions; also returns how many are left.
fn hold(
    information: &DMatrix<f64>,
    fit: &Fit,
    readiness: impl Fn(usize) -> Option<usize>,
) -> (Vec<usize>, usize) {
    let part = |of: &[usize]| loose_directions(&submatrix(information, of, of));
    let mut left: Vec<usize> = (0..fit.columns.len()).collect();
    let mut loose = part(&left);
    let mut hold = Vec::new();
    loop {
        let share = |i: &usize| -> f64 { loose.iter().map(|v| v[*i].powi(2)).sum() };
        let readiness = |i: &usize| readiness(fit.columns[left[*i]].parameter);
        let mut candidates: Vec<usize> = (0..left.len())
            .filter(|i| readiness(i).is_some() && share(i) > NEGLIGIBLE)
            .collect();
        // If shares are equal, the later parameter is held: files name the leading ones first.
        candidates.sort_by(|a, b| share(b).total_cmp(&share(a)).then(b.cmp(a)));
        candidates.sort_by_key(readiness);
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

/// Magnitude of the i-th free value, in the parameter's unit.
fn magnitude(dynamics: &Dynamics, found: &Values, fit: &Fit, i: usize) -> f64 {
    let scale = dynamics.parameters[fit.columns[i].parameter].scale;
    found.get(fit.columns[i]).abs().max(1e-3 * scale)
}

fn relative_information(dynamics: &Dynamics, found: &Values, fit: &Fit) -> DMatrix<f64> {
    let all = fit.equations();
    let magnitude = |i: usize| magnitude(dynamics, found, fit, i);
    let size = fit.columns.len();
    DMatrix::from_fn(size, size, |i, j| {
        all.hessian[(i, j)] * magnitude(i) * magnitude(j)
    })
}

fn loose_directions(information: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let size = information.nrows();
    let Some(eigen) = eigen(information.clone()) else {
        // Information that is not finite determines nothing.
        let axis = |i: usize| (0..size).map(|k| f64::from(u8::from(k == i))).collect();
        return (0..size).map(axis).collect();
    };
    // The information of each parameter is rounded separately.
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
