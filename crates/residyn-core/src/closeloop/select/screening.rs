use std::ops::{AddAssign, Range};

use nalgebra::DVector;
use rayon::prelude::*;

use super::candidate::{beside, best_start, has_switch, screened_cost_on_sample, switches};
use super::equations::solve;
use super::folds::{Folds, predicted, step_without};
use super::knowledge::Knowledge;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::identify::{Column, Values, WindowTerms, as_it_stands, submatrix};
use crate::model::{EffectParameter, FittedEffect};

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
    /// What the declared values say, where they count as in a [`Trial`](super::Trial).
    declared: Option<WindowTerms>,
    knowledge: Knowledge,
    /// From the settings.
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
        let start = |candidate: &FittedEffect| {
            let beside = beside(problem, fitted, candidate)?;
            let mut parameters = candidate.effect.parameters.iter();
            match parameters.all(EffectParameter::is_switch) {
                true => Some(candidate.clone()),
                false => best_start(problem, &beside, candidate),
            }
        };
        let options = candidates
            .par_iter()
            .filter(|candidate| has_switch(candidate));
        let options = together(problem, fitted, options.filter_map(start).collect());
        let model = fitted.model.with_effects(fitted.effects_and(&options));
        let dynamics = problem.compiled(&model);
        let added = problem.added(&model);
        let places: Vec<Range<usize>> = added.clone().map(|k| model.place_of(k)).collect();
        let present = problem.added(&fitted.model).len();
        let switches = switches(&model);
        // The values that shape an absent effect change nothing.
        let shapes = |k: &usize| {
            let mut absent = places[present..].iter();
            absent.any(|place| place.contains(k)) && !switches.contains(k)
        };
        let mut active = problem.active(&dynamics);
        active.retain(|k| !shapes(k));
        let (start_states, scale) = (fitted.fit.start_states.clone(), fitted.fit.scale);
        let fit = as_it_stands(&problem.shooting, &dynamics, &active, start_states, scale).ok()?;
        let values = Values::of(&dynamics, problem.logs);
        let room = |column: &Column| {
            let [low, high] = dynamics.parameters[column.parameter].bounds;
            let at = values.get(*column);
            [(low - at).min(0.0), (high - at).max(0.0)]
        };
        let to_zero = |column: &Column| match switches.contains(&column.parameter) {
            true => -values.get(*column),
            false => 0.0,
        };
        let is_base = |k: usize| !places.iter().any(|place| place.contains(&k));
        let folds = Folds::of(problem);
        let (blocks, groups) = folds.equations(&fit);
        Some(Self {
            items: model.effects[added].to_vec(),
            present,
            columns_of: (places.iter())
                .map(|place| fit.columns_of(|k| place.contains(&k)))
                .collect(),
            base: fit.columns_of(is_base),
            message: fit.columns_of(|k| is_base(k) && problem.is_identifiable(k)),
            room: fit.columns.iter().map(room).collect(),
            to_zero: fit.columns.iter().map(to_zero).collect(),
            groups_of: folds.groups,
            blocks,
            groups,
            all: fit.equations_and_prior(),
            declared: problem.is_by_law().then(|| fit.declared_values()),
            knowledge: Knowledge::of(problem, &model, &fit),
            kept_information: problem.settings.select.kept_information,
        })
    }

    /// The items that the model has.
    pub fn present(&self) -> Set {
        (0..self.present).collect()
    }

    /// The items of a set.
    pub fn effects(&self, set: &[usize]) -> Vec<FittedEffect> {
        set.iter().map(|&item| self.items[item].clone()).collect()
    }

    /// Predicted loss of a set, each block with the parameters that a fit without the block's group would give; `None`
    /// if the logs do not distinguish its values.
    pub fn loss(&self, set: &[usize]) -> Option<f64> {
        let minimum = self.minimum(set)?;
        let (free, moved) = (&minimum.free, &minimum.moved);
        let rows: Vec<usize> = [free.as_slice(), moved].concat();
        let at = self.step(&minimum)?.select_rows(&rows);
        let all = submatrix(&self.all.hessian, free, free);
        let without = |group: &WindowTerms| {
            let own = submatrix(&group.hessian, free, free);
            let gradient =
                group.gradient.select_rows(free) + submatrix(&group.hessian, free, &rows) * &at;
            let step = step_without(&all, &own, &gradient, self.kept_information);
            let mut there = at.clone();
            there.rows_mut(0, free.len()).add_assign(&step);
            there
        };
        let steps: Vec<DVector<f64>> = self.groups.iter().map(without).collect();
        let loss = |part: &WindowTerms, step: &DVector<f64>| {
            let gradient = part.gradient.select_rows(&rows);
            let hessian = submatrix(&part.hessian, &rows, &rows);
            predicted(part.cost, &gradient, &hessian, step)
        };
        let blocks = self.blocks.iter().zip(&self.groups_of);
        let of_logs: f64 = blocks.map(|(part, &group)| loss(part, &steps[group])).sum();
        let declared = self.declared.as_ref();
        Some(of_logs + declared.map_or(0.0, |declared| loss(declared, &at)))
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
        if !(self.knowledge).distinguishes(&message, self.message.len()) {
            return None;
        }
        loop {
            let step = self.step(&minimum)?;
            let beyond = |&i: &usize| {
                let [low, high] = self.room[i];
                (step[i] - step[i].clamp(low, high)).abs() / step[i].abs().max(f64::MIN_POSITIVE)
            };
            let free = minimum.free.iter().copied();
            let worst = free.max_by(|a, b| beyond(a).total_cmp(&beyond(b)));
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
        let matrix = submatrix(&self.all.hessian, free, free);
        let displaced = submatrix(&self.all.hessian, free, moved) * held.select_rows(moved);
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
    let size = |option: &FittedEffect| {
        let parameters = option.effect.parameters.iter();
        parameters.filter(|parameter| parameter.is_switch()).count()
    };
    if options.iter().map(size).sum::<usize>() <= room {
        return options;
    }
    let predicted = options.par_iter().enumerate();
    let predicted = predicted
        .filter_map(|(k, option)| Some((screened_cost_on_sample(problem, fitted, option)?, k)));
    let mut predicted: Vec<(f64, usize)> = predicted.collect();
    predicted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let fits = predicted.iter().scan(0, |sum, (_, k)| {
        *sum += size(&options[*k]);
        (*sum <= room).then_some(*k)
    });
    let mut kept: Vec<usize> = fits.collect();
    kept.sort_unstable();
    kept.into_iter().map(|k| options[k].clone()).collect()
}
