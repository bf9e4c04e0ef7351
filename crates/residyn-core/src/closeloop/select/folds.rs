use nalgebra::{DMatrix, DVector};

use crate::closeloop::problem::Problem;
use crate::identify::{Fit, WindowTerms, blocks, with_unit_diagonal};

/// The windows of a problem in stretches that losses are given for, and in groups that are left out of a fit together.
pub struct Folds {
    /// The stretch of each window.
    pub stretches: Vec<usize>,
    /// The group of each stretch: its log or, where there are few logs, a part of it.
    pub groups: Vec<usize>,
    /// What is known of each value without its group, as a share of the information of all.
    kept_information: f64,
}

impl Folds {
    pub fn of(problem: &Problem<'_>) -> Self {
        let shooting = &problem.shooting;
        let stretches = blocks(shooting);
        let count = stretches.last().map_or(0, |last| last + 1);
        let mut log_of = vec![0; count];
        for (window, &stretch) in shooting.windows.iter().zip(&stretches) {
            log_of[stretch] = window.log;
        }
        let logs = shooting.logs.len();
        let parts = problem.settings.select.fewest_groups.div_ceil(logs);
        // What is left out together is connected: a model is to hold for motion that it was not fitted to.
        let group = |(stretch, &log): (usize, &usize)| {
            let first = log_of.partition_point(|of| *of < log);
            let own = log_of.partition_point(|of| *of <= log) - first;
            log * parts + (stretch - first) * parts / own
        };
        let groups = log_of.iter().enumerate().map(group).collect();
        Self {
            stretches,
            groups,
            kept_information: problem.settings.select.kept_information,
        }
    }

    /// The same stretches, each left out alone.
    pub fn alone(mut self) -> Self {
        self.groups = (0..self.groups.len()).collect();
        self
    }

    /// The same stretches, of which every second one is left out together with all others like it.
    pub fn in_halves(mut self) -> Self {
        let stretches = self.groups.len();
        self.groups = (0..stretches).map(|stretch| stretch % 2).collect();
        self
    }

    /// Number of groups, some of which may be empty.
    fn count(&self) -> usize {
        self.groups.iter().max().map_or(0, |last| last + 1)
    }

    /// Normal equations of each stretch and of each group.
    pub fn equations(&self, fit: &Fit) -> (Vec<WindowTerms>, Vec<WindowTerms>) {
        let stretches = fit.equations_by(&self.stretches);
        let mut groups = vec![fit.zero_equations(); self.count()];
        for (part, &group) in stretches.iter().zip(&self.groups) {
            groups[group].cost += part.cost;
            groups[group].gradient += &part.gradient;
            groups[group].hessian += &part.hessian;
        }
        (stretches, groups)
    }
}

/// The loss on each stretch of a problem's windows, with the parameters that a fit without the stretch's group would give.
/// The fit is not repeated: each window's loss is taken as quadratic around the joint optimum, where leaving out a group
/// moves the parameters by (H - `H_k`)^-1 `g_k`. A log that is left out whole keeps the values that it has of its own, since
/// no other log determines them.
pub fn left_out_losses(problem: &Problem<'_>, fit: &Fit) -> Vec<f64> {
    losses_by(&Folds::of(problem), fit)
}

/// The same with given folds.
pub fn losses_by(folds: &Folds, fit: &Fit) -> Vec<f64> {
    let steps = steps_without(folds, fit);
    let stretches = fit.equations_by(&folds.stretches);
    let loss = |(part, &group): (&WindowTerms, &usize)| {
        predicted(part.cost, &part.gradient, &part.hessian, &steps[group])
    };
    stretches.iter().zip(&folds.groups).map(loss).collect()
}

/// The loss after a step, taken as quadratic. Sums of squares are never negative: what falls far below zero is rounding, from
/// a step along a value that nothing determines, and no loss is known there.
pub fn predicted(
    cost: f64,
    gradient: &DVector<f64>,
    hessian: &DMatrix<f64>,
    step: &DVector<f64>,
) -> f64 {
    let loss = cost + gradient.dot(step) + 0.5 * step.dot(&(hessian * step));
    if loss < -cost {
        f64::INFINITY
    } else {
        loss.max(0.0)
    }
}

/// For each group, the step of a fit's values when it is left out.
pub fn steps_without(folds: &Folds, fit: &Fit) -> Vec<DVector<f64>> {
    let (_, groups) = folds.equations(fit);
    let all = fit.equations_and_prior();
    let step = |part: &WindowTerms| {
        // At a bound the gradients do not sum to zero; what the bound carries must not move the rest.
        let own = &part.gradient - &all.gradient * share(&part.hessian, &all.hessian);
        step_without(&all.hessian, &part.hessian, &own, folds.kept_information)
    };
    groups.iter().map(step).collect()
}

/// The part of the information that one group holds.
fn share(part: &DMatrix<f64>, all: &DMatrix<f64>) -> f64 {
    part.trace() / all.trace().max(f64::MIN_POSITIVE)
}

/// The step of the free values when a part of the windows, with this gradient where they stand, is left out of a fit.
/// Directions of which little more than `kept_information` is known otherwise, as a share of all, hardly move.
pub fn step_without(
    all: &DMatrix<f64>,
    part: &DMatrix<f64>,
    gradient: &DVector<f64>,
    kept_information: f64,
) -> DVector<f64> {
    // Relative units, so that a parameter in N m s/rad weighs as much as one in 1/s^2.
    let (_, unit) = with_unit_diagonal(all);
    let rest = DMatrix::from_fn(unit.len(), unit.len(), |i, j| {
        let known = (all[(i, j)] - part[(i, j)]) * unit[i] * unit[j];
        if i == j {
            known + kept_information
        } else {
            known
        }
    });
    match rest.cholesky() {
        Some(factor) => factor
            .solve(&gradient.component_mul(&unit))
            .component_mul(&unit),
        None => DVector::zeros(unit.len()),
    }
}
