use std::ops::{AddAssign, Range};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidate::{beside, best_start, has_switch, screened_cost_on_sample};
use super::folds::{Folds, predicted, step_without};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::identify::{Column, Fit, WindowTerms, as_it_stands, with_unit_diagonal};
use crate::model::{Dynamics, EffectParameter, FittedEffect};

/// The predicted gain of sets of effects added to a fitted model: its loss as a quadratic function of its parameters
/// and those of every candidate at once. Sets are compared without a fit, and candidates that help only together are
/// found together.
pub struct Screening {
    /// The effects that the model has beyond the declared ones, then the candidates at their best starting points.
    pub items: Vec<FittedEffect>,
    /// Number of items that the model has.
    present: usize,
    /// The free values of each item.
    columns_of: Vec<Vec<usize>>,
    /// Free values that belong to no item; then those of them that the logs determine.
    base: Vec<usize>,
    message: Vec<usize>,
    /// Distance of each free value to its bounds; then to being switched off.
    room: Vec<[f64; 2]>,
    to_zero: Vec<f64>,
    groups_of: Vec<usize>,
    blocks: Vec<WindowTerms>,
    groups: Vec<WindowTerms>,
    all: WindowTerms,
    /// Information of the logs alone, without the prior.
    information: DMatrix<f64>,
    /// From the settings.
    own_information: f64,
    kept_information: f64,
}

/// A set of items, in rising order.
pub type Set = Vec<usize>;

/// The predicted minimum of the loss for one set.
struct Minimum {
    free: Vec<usize>,
    /// Displacement of the values that are not free: those of dropped effects, and those that stop at a bound.
    held: DVector<f64>,
    moved: Vec<usize>,
}

impl Screening {
    /// The loss of `fitted` with all candidates; `None` if the model diverges.
    pub fn of(problem: &Problem<'_>, fitted: &Fitted, candidates: &[FittedEffect]) -> Option<Self> {
        let options: Vec<FittedEffect> = candidates
            .par_iter()
            .filter(|candidate| has_switch(candidate))
            .filter_map(|candidate| {
                let beside = beside(problem, fitted, candidate)?;
                if candidate
                    .effect
                    .parameters
                    .iter()
                    .all(EffectParameter::is_switch)
                {
                    return Some(candidate.clone());
                }
                best_start(problem, &beside, candidate)
            })
            .collect();
        let options = together(problem, fitted, options);
        let model = fitted.model.with_effects(fitted.effects_and(&options));
        let dynamics = problem.compiled(&model);
        let added = problem.declared.effects.len()..model.effects.len();
        let places: Vec<Range<usize>> = added.clone().map(|k| model.place_of(k)).collect();
        let present = problem.added(&fitted.model).len();
        // The values that shape an absent effect change nothing.
        let shapes = |k: &usize| {
            let item = places.iter().position(|place| place.contains(k));
            item.is_some_and(|item| {
                let parameters = &model.effects[added.start + item].effect.parameters;
                item >= present && !parameters[k - places[item].start].is_switch()
            })
        };
        let mut active = problem.active(&dynamics);
        active.retain(|k| !shapes(k));
        let (start_states, scale) = (fitted.fit.start_states.clone(), fitted.fit.scale);
        let fit = as_it_stands(&problem.shooting, &dynamics, &active, start_states, scale).ok()?;
        let items = model.effects[added].to_vec();
        Some(Self::from_fit(
            problem, &dynamics, &fit, items, &places, present,
        ))
    }

    fn from_fit(
        problem: &Problem<'_>,
        dynamics: &Dynamics,
        fit: &Fit,
        items: Vec<FittedEffect>,
        places: &[Range<usize>],
        present: usize,
    ) -> Self {
        let values = crate::identify::Values::of(dynamics, problem.logs);
        let of_item = |place: &Range<usize>| -> Vec<usize> {
            let columns = fit.columns.iter().enumerate();
            let own = columns.filter(|(_, column)| place.contains(&column.parameter));
            own.map(|(i, _)| i).collect()
        };
        let columns_of: Vec<Vec<usize>> = places.iter().map(of_item).collect();
        let is_base = |i: &usize| !columns_of.iter().any(|of| of.contains(i));
        let room = |column: &Column| {
            let [low, high] = dynamics.parameters[column.parameter].bounds;
            let at = values.get(*column);
            [(low - at).min(0.0), (high - at).max(0.0)]
        };
        let to_zero = |column: &Column| {
            let place = places.iter().zip(&items);
            let mut of = place.filter(|(place, _)| place.contains(&column.parameter));
            let is_switch = of.next().is_some_and(|(place, item)| {
                item.effect.parameters[column.parameter - place.start].is_switch()
            });
            if is_switch { -values.get(*column) } else { 0.0 }
        };
        let folds = Folds::of(problem);
        let (blocks, groups) = folds.equations(fit);
        let base: Vec<usize> = (0..fit.columns.len()).filter(is_base).collect();
        let message = |i: &&usize| problem.is_identifiable(fit.columns[**i].parameter);
        Self {
            message: base.iter().filter(message).copied().collect(),
            base,
            room: fit.columns.iter().map(room).collect(),
            to_zero: fit.columns.iter().map(to_zero).collect(),
            groups_of: folds.groups,
            all: fit.equations_and_prior(),
            information: fit.equations().hessian,
            own_information: problem.settings.select.own_information,
            kept_information: problem.settings.select.kept_information,
            items,
            present,
            columns_of,
            blocks,
            groups,
        }
    }

    /// The items that the model has.
    pub fn present(&self) -> Set {
        (0..self.present).collect()
    }

    /// The items of a set.
    pub fn effects(&self, set: &[usize]) -> Vec<FittedEffect> {
        set.iter().map(|&item| self.items[item].clone()).collect()
    }

    /// Predicted loss of a set on each block, with the parameters that a fit without the block's group would give.
    pub fn losses(&self, set: &[usize]) -> Option<Vec<f64>> {
        let minimum = self.minimum(set)?;
        let (free, moved) = (&minimum.free, &minimum.moved);
        let rows: Vec<usize> = [free.as_slice(), moved].concat();
        let at = self.step(&minimum)?.select_rows(&rows);
        let all = sub(&self.all.hessian, free, free);
        let without = |group: &WindowTerms| {
            let gradient =
                group.gradient.select_rows(free) + sub(&group.hessian, free, &rows) * &at;
            let step = step_without(
                &all,
                &sub(&group.hessian, free, free),
                &gradient,
                self.kept_information,
            );
            let mut there = at.clone();
            there.rows_mut(0, free.len()).add_assign(&step);
            there
        };
        let steps: Vec<DVector<f64>> = self.groups.iter().map(without).collect();
        let loss = |(part, &group): (&WindowTerms, &usize)| {
            let step = &steps[group];
            let gradient = part.gradient.select_rows(&rows);
            let hessian = sub(&part.hessian, &rows, &rows);
            predicted(part.cost, &gradient, &hessian, step)
        };
        Some(self.blocks.iter().zip(&self.groups_of).map(loss).collect())
    }

    /// Which values of a set are free at the minimum of the loss, and the values of the others.
    fn minimum(&self, set: &[usize]) -> Option<Minimum> {
        let mut free = self.base.clone();
        let mut held = DVector::zeros(self.room.len());
        let mut moved = Vec::new();
        for (item, columns) in self.columns_of.iter().enumerate() {
            if set.contains(&item) {
                free.extend(columns);
            } else if item < self.present {
                for &i in columns {
                    held[i] = self.to_zero[i];
                    moved.push(i);
                }
            }
        }
        let mut minimum = Minimum { free, held, moved };
        let message = [&self.message, &minimum.free[self.base.len()..]].concat();
        let information = sub(&self.information, &message, &message);
        if !distinguishes(&information, self.message.len(), self.own_information) {
            return None;
        }
        loop {
            let step = self.step(&minimum)?;
            let beyond = |&i: &usize| {
                let [low, high] = self.room[i];
                (step[i] - step[i].clamp(low, high)).abs() / step[i].abs().max(f64::MIN_POSITIVE)
            };
            let worst = minimum
                .free
                .iter()
                .copied()
                .max_by(|a, b| beyond(a).total_cmp(&beyond(b)));
            match worst.filter(|i| beyond(i) > 1e-9) {
                None => return Some(minimum),
                Some(i) => {
                    minimum.held[i] = step[i].clamp(self.room[i][0], self.room[i][1]);
                    minimum.free.retain(|k| *k != i);
                    minimum.moved.push(i);
                }
            }
        }
    }

    /// The displacement of all values at the minimum of the loss.
    fn step(&self, minimum: &Minimum) -> Option<DVector<f64>> {
        let Minimum { free, held, moved } = minimum;
        let matrix = sub(&self.all.hessian, free, free);
        let displaced = sub(&self.all.hessian, free, moved) * held.select_rows(moved);
        let solution = solve(&matrix, &(self.all.gradient.select_rows(free) + displaced))?;
        let mut step = held.clone();
        for (&i, value) in free.iter().zip(solution.iter()) {
            step[i] = -value;
        }
        Some(step)
    }
}

/// The candidates that are compared at once: all or, if memory does not suffice, those with the largest predicted gain
/// alone.
fn together(
    problem: &Problem<'_>,
    fitted: &Fitted,
    options: Vec<FittedEffect>,
) -> Vec<FittedEffect> {
    // Each window's equations with and without its own free values, and those of the blocks.
    let equations = 3 * problem.shooting.windows.len().max(1);
    let values = (problem.settings.select.most_numbers as f64 / equations as f64).sqrt() as usize;
    let room = values.saturating_sub(fitted.fit.columns.len());
    let switches = |option: &FittedEffect| {
        let parameters = option.effect.parameters.iter();
        parameters.filter(|parameter| parameter.is_switch()).count()
    };
    if options.iter().map(switches).sum::<usize>() <= room {
        return options;
    }
    let predicted = options.par_iter().enumerate();
    let predicted = predicted
        .filter_map(|(k, option)| Some((screened_cost_on_sample(problem, fitted, option)?, k)));
    let mut predicted: Vec<(f64, usize)> = predicted.collect();
    predicted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let fits = predicted.iter().scan(0, |sum, (_, k)| {
        *sum += switches(&options[*k]);
        (*sum <= room).then_some(*k)
    });
    let mut kept: Vec<usize> = fits.collect();
    kept.sort_unstable();
    kept.into_iter().map(|k| options[k].clone()).collect()
}

/// Whether the logs distinguish the values after the first `base` from each other and from those: the share of the
/// information on each that is left when the values before it are free must exceed `least`.
pub fn distinguishes(matrix: &DMatrix<f64>, base: usize, least: f64) -> bool {
    let (mut scaled, _) = with_unit_diagonal(matrix);
    for i in 0..scaled.nrows() {
        scaled[(i, i)] += RIDGE;
    }
    let Some(factor) = scaled.cholesky() else {
        return false;
    };
    let own = factor.l_dirty().diagonal();
    own.iter().skip(base).all(|own| own.powi(2) > least)
}

fn sub(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
        matrix[(rows[i], columns[j])]
    })
}

/// Smallest information on a direction, in units in which each value alone has 1: redundant items share it.
const RIDGE: f64 = 1e-9;

fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let (mut scaled, unit) = with_unit_diagonal(matrix);
    for i in 0..unit.len() {
        scaled[(i, i)] += RIDGE;
    }
    let solution = scaled.cholesky()?.solve(&right.component_mul(&unit));
    Some(solution.component_mul(&unit))
}
