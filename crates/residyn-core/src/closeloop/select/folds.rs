use nalgebra::{DMatrix, DVector};

use crate::closeloop::problem::Problem;
use crate::identify::{Fit, WindowTerms, blocks, count, with_unit_diagonal};

/// Half of the logs is left out from this many logs on: a single log seldom holds the motion that tells effects apart.
const HALVED_LOGS: usize = 4;

/// A problem's windows in blocks, for each of which a loss is given, and in groups, which are left out of a fit
/// together.
pub struct Folds {
    /// The block of each window.
    pub blocks: Vec<usize>,
    /// The group of each block: its log or, if there are few logs, a part of it.
    pub groups: Vec<usize>,
    /// The log of each block, and the number of logs.
    log_of: Vec<usize>,
    logs: usize,
    /// The share of the information on each value that is taken to be known without its group.
    kept_information: f64,
}

impl Folds {
    pub fn of(problem: &Problem<'_>) -> Self {
        let shooting = &problem.shooting;
        let blocks = blocks(shooting);
        let mut log_of = vec![0; count(&blocks)];
        for (window, &block) in shooting.windows.iter().zip(&blocks) {
            log_of[block] = window.log;
        }
        let logs = shooting.logs.len();
        let parts = problem.settings.select.fewest_groups.div_ceil(logs);
        // Groups are contiguous: a model must hold for motion that it was not fitted to.
        let group = |(block, &log): (usize, &usize)| {
            let first = log_of.partition_point(|of| *of < log);
            let own = log_of.partition_point(|of| *of <= log) - first;
            log * parts + (block - first) * parts / own
        };
        let groups = log_of.iter().enumerate().map(group).collect();
        Self {
            blocks,
            log_of,
            logs,
            groups,
            kept_information: problem.settings.select.kept_information,
        }
    }

    /// These blocks, each left out alone.
    pub fn alone(mut self) -> Self {
        self.groups = (0..self.groups.len()).collect();
        self
    }

    /// These blocks in two groups: every other log or, of few logs, the odd and the even blocks.
    pub fn in_halves(mut self) -> Self {
        let half = |(block, log): (usize, &usize)| match self.logs < HALVED_LOGS {
            true => block % 2,
            false => log % 2,
        };
        self.groups = self.log_of.iter().enumerate().map(half).collect();
        self
    }

    /// Normal equations of each group.
    pub fn equations(&self, fit: &Fit) -> Vec<WindowTerms> {
        let group = |block: &usize| self.groups[*block];
        fit.equations_by(&self.blocks.iter().map(group).collect::<Vec<usize>>())
    }
}

/// The loss on each block, with the parameters that a fit without the block's group would give. The fit is not repeated:
/// each window's loss is taken as quadratic around the joint optimum, where leaving out a group moves the parameters by
/// (H - `H_k`)^-1 `g_k`. A log that is left out whole keeps its per-log values, since no other log determines them.
pub fn left_out_losses(folds: &Folds, fit: &Fit) -> Vec<f64> {
    let steps = steps_without(folds, fit);
    let blocks = fit.equations_by(&folds.blocks);
    let loss = |(part, &group): (&WindowTerms, &usize)| {
        let step = &steps[group];
        let curvature = step.dot(&(&part.hessian * step));
        predicted(part.cost, part.gradient.dot(step), curvature)
    };
    blocks.iter().zip(&folds.groups).map(loss).collect()
}

/// The loss after a step along which it has this slope and curvature. Sums of squares are never negative: a loss far
/// below zero is rounding, from a step along an undetermined value, and is unknown.
pub fn predicted(cost: f64, slope: f64, curvature: f64) -> f64 {
    let loss = cost + slope + 0.5 * curvature;
    match loss < -cost {
        true => f64::INFINITY,
        false => loss.max(0.0),
    }
}

/// For each group, the step of a fit's values when the group is left out.
pub fn steps_without(folds: &Folds, fit: &Fit) -> Vec<DVector<f64>> {
    let groups = folds.equations(fit);
    let all = fit.equations_and_prior();
    let step = |part: &WindowTerms| {
        // At a bound the gradients do not sum to zero; the bound's part must not move the rest.
        let share = part.hessian.trace() / all.hessian.trace().max(f64::MIN_POSITIVE);
        let own = &part.gradient - &all.gradient * share;
        step_without(&all.hessian, &part.hessian, &own, folds.kept_information)
    };
    groups.iter().map(step).collect()
}

/// The step of the free values when a part of the windows, with this gradient at the fit, is left out. Directions on
/// which the other windows hold little more than the share `kept_information` of all information hardly move.
pub fn step_without(
    all: &DMatrix<f64>,
    part: &DMatrix<f64>,
    gradient: &DVector<f64>,
    kept_information: f64,
) -> DVector<f64> {
    let (rest, unit) = known_without(all, part, kept_information);
    let Some(factor) = rest.cholesky() else {
        return DVector::zeros(unit.len());
    };
    let step = factor.solve(&gradient.component_mul(&unit));
    step.component_mul(&unit)
}

/// The information that is left without a part of the windows, and the share that is kept, in the units that it returns:
/// relative ones, so that a parameter in N m s/rad weighs as much as one in 1/s^2.
pub fn known_without(
    all: &DMatrix<f64>,
    part: &DMatrix<f64>,
    kept_information: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let (_, unit) = with_unit_diagonal(all);
    let rest = DMatrix::from_fn(unit.len(), unit.len(), |i, j| {
        let known = (all[(i, j)] - part[(i, j)]) * unit[i] * unit[j];
        if i == j {
            known + kept_information
        } else {
            known
        }
    });
    (rest, unit)
}
