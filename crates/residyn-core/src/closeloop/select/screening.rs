use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::candidate::{best_starts, has_switch, screened_cost_on_sample, switches};
use super::equations::{Eliminated, solve};
use super::folds::{Folds, known_without, predicted, step_without};
use super::knowledge::Knowledge;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::identify::{Column, Values, WindowTerms, as_it_stands, submatrix};
use crate::model::FittedEffect;

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
    /// Free values that belong to no item and that no bound stops; then those that one stops, and where.
    base: Vec<usize>,
    stopped: Vec<usize>,
    held: DVector<f64>,
    /// Distance of each free value to its bounds; then to being switched off.
    room: Vec<[f64; 2]>,
    to_zero: Vec<f64>,
    groups: Vec<WindowTerms>,
    all: WindowTerms,
    /// Those of the loss: of all windows and, where they count, of the declared values.
    counted: WindowTerms,
    /// The equations of all windows, and of those without each group, the base eliminated; `None` if they do not determine it.
    of_all: Option<Eliminated>,
    without: Vec<Option<Eliminated>>,
    /// What the declared values say, where they count as in a [`Trial`](super::Trial).
    declared: Option<WindowTerms>,
    knowledge: Knowledge,
    /// From the settings.
    kept_information: f64,
}

/// A set of items, in rising order.
pub type Set = Vec<usize>;

/// The predicted minimum of the loss for one set.
pub struct Minimum {
    /// The values of the set.
    own: Vec<usize>,
    freedom: Freedom,
    /// Displacement of all values.
    at: DVector<f64>,
    /// The loss there: that on left-out blocks is never smaller.
    pub loss: f64,
}

/// Which values are free, and where the others are held.
struct Freedom {
    free: Vec<usize>,
    /// Displacement of the values that are not free: those of dropped effects, and those that stop at a bound.
    held: DVector<f64>,
    moved: Vec<usize>,
}

impl Screening {
    /// The loss of `fitted` with all candidates, each where it promises most; `None` if the model diverges.
    pub fn of(problem: &Problem<'_>, fitted: &Fitted, candidates: &[FittedEffect]) -> Option<Self> {
        let mut switched = candidates.to_vec();
        switched.retain(has_switch);
        let options = together(problem, fitted, best_starts(problem, fitted, &switched));
        Self::with(problem, fitted, &options)
    }

    /// As [`Screening::of`], with candidates that stay where they are.
    pub fn with(problem: &Problem<'_>, fitted: &Fitted, options: &[FittedEffect]) -> Option<Self> {
        let model = fitted.model.with_effects(fitted.effects_and(options));
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
        let groups = Folds::of(problem).equations(&fit);
        let (all, base) = (fit.equations_and_prior(), fit.columns_of(is_base));
        let kept = problem.settings.select.kept_information;
        let determined = fit.columns_of(|k| is_base(k) && problem.is_identifiable(k));
        let declared = problem.is_by_law().then(|| fit.declared_values());
        let mut counted = fit.zero_equations();
        groups
            .iter()
            .chain(&declared)
            .for_each(|part| counted += part);
        let mut screening = Self {
            of_all: Eliminated::ridged(&all.hessian, &base),
            without: Vec::new(),
            items: model.effects[added].to_vec(),
            present,
            columns_of: (places.iter())
                .map(|place| fit.columns_of(|k| place.contains(&k)))
                .collect(),
            held: DVector::zeros(fit.columns.len()),
            stopped: Vec::new(),
            base,
            room: fit.columns.iter().map(room).collect(),
            to_zero: fit.columns.iter().map(to_zero).collect(),
            groups,
            all,
            counted,
            declared,
            knowledge: Knowledge::of(problem, &model, &fit, &determined),
            kept_information: kept,
        };
        screening.hold_what_bounds_stop();
        Some(screening)
    }

    /// Take for held what bounds stop in the model as it is: to find out for each set again takes most of the time.
    fn hold_what_bounds_stop(&mut self) {
        if let Some(Minimum { freedom, .. }) = self.minimum(&self.present()) {
            let base = self.base.iter().copied();
            (self.base, self.stopped) = base.partition(|value| freedom.free.contains(value));
            self.of_all = Eliminated::ridged(&self.all.hessian, &self.base);
            self.held = freedom.held;
        }
        let without = self.groups.par_iter().map(|group| {
            let own = known_without(&self.all.hessian, &group.hessian, self.kept_information);
            Eliminated::of(own, &self.base)
        });
        self.without = without.collect();
    }

    /// The items that the model has.
    pub fn present(&self) -> Set {
        (0..self.present).collect()
    }

    /// The items of a set.
    pub fn effects(&self, set: &[usize]) -> Vec<FittedEffect> {
        set.iter().map(|&item| self.items[item].clone()).collect()
    }

    /// Predicted loss of a set on blocks left out of its fit; `None` if the logs do not distinguish its values.
    pub fn loss(&self, set: &[usize]) -> Option<f64> {
        self.left_out_loss(&self.minimum(set)?)
    }

    /// Predicted loss of a set, each group of blocks with the parameters that a fit without it would give; `None` if the logs
    /// do not distinguish the set's values.
    pub fn left_out_loss(
        &self,
        Minimum {
            own, freedom, at, ..
        }: &Minimum,
    ) -> Option<f64> {
        if !self.knowledge.distinguishes(own) {
            return None;
        }
        let rows = freedom.rows();
        let of_group = |(group, there): (usize, &WindowTerms)| {
            let gradient = &there.gradient + times(&there.hessian, &freedom.free, &rows, at);
            let step = at + self.step_without(group, freedom, &gradient);
            loss_after(there, &step, &rows)
        };
        let of_logs: f64 = self.groups.iter().enumerate().map(of_group).sum();
        let declared = self.declared.as_ref();
        Some(of_logs + declared.map_or(0.0, |declared| loss_after(declared, at, &rows)))
    }

    /// The minimum of the loss over the values of a set; `None` if the equations do not determine it.
    pub fn minimum(&self, set: &[usize]) -> Option<Minimum> {
        let mut freedom = self.freedom(set);
        let own = freedom.chosen(&self.base)?.to_vec();
        let mut stopped = self.stopped.clone();
        loop {
            let at = self.step(&freedom)?;
            let beyond = |&i: &usize| {
                let [low, high] = self.room[i];
                (at[i] - at[i].clamp(low, high)).abs() / at[i].abs().max(f64::MIN_POSITIVE)
            };
            let free = freedom.free.iter().copied();
            let worst = free.max_by(|a, b| beyond(a).total_cmp(&beyond(b)));
            match worst.filter(|i| beyond(i) > 1e-9) {
                None if let Some(k) = stopped.iter().position(|i| self.turns_back(*i, &at)) => {
                    freedom.release(stopped.remove(k));
                }
                None => {
                    let loss = loss_after(&self.counted, &at, &freedom.rows());
                    return Some(Minimum {
                        own,
                        freedom,
                        at,
                        loss,
                    });
                }
                Some(i) => {
                    freedom.held[i] = at[i].clamp(self.room[i][0], self.room[i][1]);
                    freedom.free.retain(|k| *k != i);
                    freedom.moved.push(i);
                }
            }
        }
    }

    /// Whether the loss falls where a value that a bound stops goes back from it.
    fn turns_back(&self, value: usize, at: &DVector<f64>) -> bool {
        let slope = self.all.gradient[value] + self.all.hessian.column(value).dot(at);
        match at[value] <= self.room[value][0] {
            true => slope < 0.0,
            false => slope > 0.0,
        }
    }

    /// The values of a set free, those of the other effects of the model at zero.
    fn freedom(&self, set: &[usize]) -> Freedom {
        let mut free = self.base.clone();
        let mut held = DVector::zeros(self.room.len());
        let mut moved = self.stopped.clone();
        for &value in &moved {
            held[value] = self.held[value];
        }
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
        Freedom { free, held, moved }
    }

    /// The displacement of all values at the minimum of the loss over the free ones.
    fn step(&self, freedom: &Freedom) -> Option<DVector<f64>> {
        let Freedom { free, held, moved } = freedom;
        let right = &self.all.gradient + times(&self.all.hessian, free, moved, held);
        let solution = match freedom.chosen(&self.base) {
            Some(chosen) => self.of_all.as_ref()?.solve(chosen, &right)?,
            None => {
                let matrix = submatrix(&self.all.hessian, free, free);
                among(
                    free,
                    right.len(),
                    &solve(&matrix, &right.select_rows(free))?,
                )
            }
        };
        Some(held - solution)
    }

    /// The step of the free values from a minimum without a group of windows, which have this gradient there.
    fn step_without(
        &self,
        group: usize,
        freedom: &Freedom,
        gradient: &DVector<f64>,
    ) -> DVector<f64> {
        let (free, size) = (&freedom.free, gradient.len());
        if let Some(chosen) = freedom.chosen(&self.base) {
            let known = self.without[group].as_ref();
            let step = known.and_then(|known| known.solve(chosen, gradient));
            return step.unwrap_or_else(|| DVector::zeros(size));
        }
        let [all, own] = [&self.all, &self.groups[group]];
        let [all, own] = [all, own].map(|terms| submatrix(&terms.hessian, free, free));
        let gradient = gradient.select_rows(free);
        let step = step_without(&all, &own, &gradient, self.kept_information);
        among(free, size, &step)
    }
}

impl Freedom {
    /// The values that differ from those of the model.
    fn rows(&self) -> Vec<usize> {
        [self.free.as_slice(), &self.moved].concat()
    }

    /// Free a value that is held.
    fn release(&mut self, value: usize) {
        self.moved.retain(|moved| *moved != value);
        self.held[value] = 0.0;
        self.free.push(value);
    }

    /// The free values after those of the base, if all of that is free.
    fn chosen(&self, base: &[usize]) -> Option<&[usize]> {
        self.free.strip_prefix(base)
    }
}

/// A quadratic loss after a step of these values.
fn loss_after(part: &WindowTerms, step: &DVector<f64>, rows: &[usize]) -> f64 {
    let curvature = step.dot(&times(&part.hessian, rows, rows, step));
    predicted(part.cost, part.gradient.dot(step), curvature)
}

/// A part of a matrix times that of a vector, in the order of all values, the others zero.
fn times(
    matrix: &DMatrix<f64>,
    rows: &[usize],
    columns: &[usize],
    vector: &DVector<f64>,
) -> DVector<f64> {
    let (mut product, size) = (vec![0.0; vector.len()], matrix.nrows());
    let runs = runs(rows);
    for &column in columns {
        let factor = vector[column];
        let values = &matrix.as_slice()[size * column..][..size];
        for run in &runs {
            let both = product[run.clone()].iter_mut().zip(&values[run.clone()]);
            both.for_each(|(sum, value)| *sum += factor * value);
        }
    }
    product.into()
}

/// Places as ranges of places that follow each other: most do.
fn runs(places: &[usize]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for &place in places {
        match runs.last_mut() {
            Some(run) if run.end == place => run.end += 1,
            _ => runs.push(place..place + 1),
        }
    }
    runs
}

/// Values at these places, zero at the others.
fn among(places: &[usize], size: usize, values: &DVector<f64>) -> DVector<f64> {
    let mut all = DVector::zeros(size);
    for (&place, value) in places.iter().zip(values.iter()) {
        all[place] = *value;
    }
    all
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
