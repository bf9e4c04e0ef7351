use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use super::sensitivity::{Local, Tangent};
use super::shooting::{Shooting, WindowTerms};
use super::values::{Column, Layout, Own, Values, value_of};
use crate::data::statistics::{SIGMA_PER_MAD, upper_median};
use crate::model::Dynamics;

/// Why parameters could not be fitted.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    #[error(
        "the logs give no window to fit: every stretch is shorter than a window, broken by a gap or left out; record longer logs or leave out less"
    )]
    NoWindow,
    #[error(
        "with its starting values the model diverges in {diverged} of {windows} windows of the logs; give parameters nearer to the rig in the model file"
    )]
    Diverged { diverged: usize, windows: usize },
}

/// The outcome of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// All parameters of the model, in its order; of a parameter with a value per log, what holds in a log
    /// that has none of its own.
    pub values: Vec<f64>,
    /// The values that single logs have of their own.
    pub own: Vec<Own>,
    /// Which parameters were free.
    pub active: Vec<usize>,
    /// The free values: one column for each free parameter, or one for each log where it differs by log.
    pub columns: Vec<Column>,
    /// Each window's own values: its start state, then forces if they were free.
    pub locals: Vec<Vec<f64>>,
    /// Robust standard deviation of the normalised residuals: 1 where the model explains all but noise.
    pub scale: f64,
    /// Sum of the losses at that scale.
    pub cost: f64,
    /// What each window says about the free parameters, its own values eliminated.
    pub reduced: Vec<Reduced>,
    /// Steps that were taken.
    pub iterations: usize,
}

/// What one window says about some of a fit's columns.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// Numbers of these columns, in the order of `terms`.
    pub columns: Vec<usize>,
    pub terms: WindowTerms,
}

impl Fit {
    /// The values that it found, as another fit takes them.
    pub fn found(&self) -> Values {
        Values {
            common: self.values.clone(),
            own: self.own.clone(),
        }
    }

    /// All parameters as they are in a log.
    pub fn values_of_log(&self, log: usize) -> Vec<f64> {
        self.found().of_log(log)
    }

    /// The value of the i-th column.
    pub fn value(&self, i: usize) -> f64 {
        value_of(&self.values, &self.own, self.columns[i])
    }

    /// What windows that say nothing say about the columns.
    pub fn nothing(&self) -> WindowTerms {
        WindowTerms::zeros(self.columns.len())
    }
}

impl Reduced {
    /// Add what this window says to what others say about all columns.
    pub fn add_to(&self, all: &mut WindowTerms) {
        all.cost += self.terms.cost;
        self.add_gradient_to(&mut all.gradient);
        scatter_matrix(&self.terms.hessian, &mut all.hessian, &self.columns);
    }

    /// The same for the gradient alone.
    pub fn add_gradient_to(&self, all: &mut DVector<f64>) {
        scatter(&self.terms.gradient, all, &self.columns);
    }
}

fn scatter(part: &DVector<f64>, all: &mut DVector<f64>, places: &[usize]) {
    for (value, &place) in part.iter().zip(places) {
        all[place] += value;
    }
}

fn scatter_matrix(part: &DMatrix<f64>, all: &mut DMatrix<f64>, places: &[usize]) {
    for (j, &column) in places.iter().enumerate() {
        for (i, &row) in places.iter().enumerate() {
            all[(row, column)] += part[(i, j)];
        }
    }
}

/// Most steps of one fit; Gauss-Newton on such problems needs 3 to 15.
const MOST_STEPS: usize = 40;
/// A fit that estimates ends when a step lowers the cost by less than this share.
const ENOUGH: f64 = 1e-6;
/// A fit at a given scale is for comparing models, which differ by more than this share of the cost or not at all.
const ENOUGH_TO_COMPARE: f64 = 1e-4;

/// Fit the parameters `active` of `dynamics` to the windows, starting from `values` and `locals`, with
/// every window's start state (and forces) free: Levenberg-Marquardt with the windows' own values
/// eliminated by the Schur complement. `scale` fixes the scale of the residuals; without it, it is estimated
/// by their median absolute deviation as the fit proceeds.
///
/// # Errors
/// No window, or a model that diverges at the starting values.
pub fn fit(
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    values: impl Into<Values>,
    locals: Vec<Vec<f64>>,
    scale: Option<f64>,
) -> Result<Fit, FitError> {
    let local = if locals.first().is_some_and(|l| l.len() > dynamics.states()) {
        Local::StateAndForce
    } else {
        Local::State
    };
    let tangent = Tangent::new(dynamics, active, local);
    let mut search = Search::new(shooting, dynamics, &tangent, values.into(), locals, scale)?;
    while search.iterations < MOST_STEPS && search.step() {}
    // A last look with a scale that belongs to the final residuals.
    if scale.is_none() {
        search.rescale();
        while search.iterations < MOST_STEPS && search.step() {}
    }
    Ok(search.finish())
}

/// A model as it stands, no value changed, and what each window says about the parameters `active` there.
///
/// # Errors
/// As [`fit`].
pub fn as_it_stands(
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    values: impl Into<Values>,
    locals: Vec<Vec<f64>>,
    scale: f64,
) -> Result<Fit, FitError> {
    let tangent = Tangent::new(dynamics, active, Local::State);
    let values = values.into();
    let search = Search::new(shooting, dynamics, &tangent, values, locals, Some(scale))?;
    Ok(search.finish())
}

/// The cost that one Gauss-Newton step promises for the model at `values`, within the parameters' bounds:
/// the worth of a candidate before it is fitted. `None` where the model diverges there.
pub fn promise(
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    values: impl Into<Values>,
    locals: &[Vec<f64>],
    scale: f64,
) -> Option<f64> {
    let tangent = Tangent::new(dynamics, active, Local::State);
    let search = Search::new(
        shooting,
        dynamics,
        &tangent,
        values.into(),
        locals.to_vec(),
        Some(scale),
    )
    .ok()?;
    let terms = shooting.linearise(dynamics, &tangent, &search.values, locals, scale);
    let size = search.layout.columns.len();
    let (mut matrix, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let mut own_gain = 0.0;
    for (terms, window) in terms.iter().zip(&shooting.windows) {
        let part = Eliminated::new(terms, active.len(), search.damping);
        own_gain += part.own_gain;
        scatter_matrix(&part.matrix, &mut matrix, search.layout.places(window));
        scatter(&part.gradient, &mut gradient, search.layout.places(window));
    }
    let step = search.bounded_solution(matrix.clone(), -&gradient);
    let gain = -gradient.dot(&step) - 0.5 * step.dot(&(matrix * &step)) + own_gain;
    gain.is_finite().then_some(search.cost - gain)
}

struct Search<'a> {
    shooting: &'a Shooting<'a>,
    dynamics: &'a Dynamics,
    tangent: &'a Tangent,
    layout: Layout,
    values: Values,
    locals: Vec<Vec<f64>>,
    scale: f64,
    cost: f64,
    /// The share of the cost by which a step must lower it for another one to follow.
    enough: f64,
    damping: f64,
    iterations: usize,
}

impl<'a> Search<'a> {
    fn new(
        shooting: &'a Shooting<'a>,
        dynamics: &'a Dynamics,
        tangent: &'a Tangent,
        values: Values,
        locals: Vec<Vec<f64>>,
        scale: Option<f64>,
    ) -> Result<Self, FitError> {
        if shooting.windows.is_empty() {
            return Err(FitError::NoWindow);
        }
        let mut search = Self {
            shooting,
            dynamics,
            tangent,
            layout: Layout::new(&dynamics.parameters, &tangent.active, &shooting.windows),
            values,
            locals,
            scale: scale.unwrap_or(1.0),
            cost: f64::INFINITY,
            enough: scale.map_or(ENOUGH, |_| ENOUGH_TO_COMPARE),
            damping: 1e-3,
            iterations: 0,
        };
        let costs = shooting.costs(dynamics, &search.values, &search.locals, search.scale);
        let diverged = costs.iter().filter(|cost| !cost.is_finite()).count();
        if diverged > 0 {
            return Err(FitError::Diverged {
                diverged,
                windows: costs.len(),
            });
        }
        if scale.is_none() {
            search.rescale();
        } else {
            search.cost = costs.iter().sum();
        }
        Ok(search)
    }

    /// Estimate the scale from the residuals at hand.
    fn rescale(&mut self) {
        let residuals = self
            .shooting
            .residuals(self.dynamics, &self.values, &self.locals);
        self.scale = robust_scale(residuals.into_iter().flatten());
        self.cost = self.total(&self.values, &self.locals);
        self.damping = 1e-3;
    }

    fn total(&self, values: &Values, locals: &[Vec<f64>]) -> f64 {
        self.shooting
            .costs(self.dynamics, values, locals, self.scale)
            .iter()
            .sum()
    }

    /// One accepted step; false when there is nothing left to gain.
    fn step(&mut self) -> bool {
        self.iterations += 1;
        let terms = self.shooting.linearise(
            self.dynamics,
            self.tangent,
            &self.values,
            &self.locals,
            self.scale,
        );
        while self.damping < 1e12 {
            let (values, locals) = self.propose(&terms);
            let cost = self.total(&values, &locals);
            if cost < self.cost {
                let gain = (self.cost - cost) / self.cost.max(f64::MIN_POSITIVE);
                (self.values, self.locals, self.cost) = (values, locals, cost);
                self.damping = (self.damping * 0.1).max(1e-12);
                return gain > self.enough;
            }
            self.damping *= 10.0;
        }
        false
    }

    fn propose(&self, terms: &[WindowTerms]) -> (Values, Vec<Vec<f64>>) {
        let (shared, size) = (self.tangent.active.len(), self.layout.columns.len());
        let mut matrix = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        let eliminated: Vec<Eliminated> = terms
            .iter()
            .map(|terms| Eliminated::new(terms, shared, self.damping))
            .collect();
        let windows = &self.shooting.windows;
        for (part, window) in eliminated.iter().zip(windows) {
            scatter_matrix(&part.matrix, &mut matrix, self.layout.places(window));
            scatter(&part.gradient, &mut gradient, self.layout.places(window));
        }
        let step = self.bounded_solution(matrix, -gradient);
        let mut values = self.values.clone();
        let mut taken = DVector::zeros(size);
        for (i, &column) in self.layout.columns.iter().enumerate() {
            let [low, high] = self.dynamics.parameters[column.parameter].bounds;
            let before = self.values.get(column);
            let after = (before + step[i]).clamp(low, high);
            values.set(column, after);
            taken[i] = after - before;
        }
        let locals = (eliminated.iter().zip(windows).zip(&self.locals))
            .map(|((part, window), local)| {
                part.local_step(&taken.select_rows(self.layout.places(window)))
                    .iter()
                    .zip(local)
                    .map(|(d, x)| x + d)
                    .collect()
            })
            .collect();
        (values, locals)
    }

    /// The damped step, with parameters that a bound would stop taken out one after the other.
    fn bounded_solution(&self, mut matrix: DMatrix<f64>, right: DVector<f64>) -> DVector<f64> {
        for (i, column) in self.layout.columns.iter().enumerate() {
            // Steps are damped against each parameter's own magnitude: a flat direction stays where it is.
            let floor = 1e-9 / self.dynamics.parameters[column.parameter].scale.powi(2);
            matrix[(i, i)] += self.damping * matrix[(i, i)] + floor;
        }
        let mut held = vec![false; right.len()];
        loop {
            let step = solve_with_held(&matrix, &right, &held);
            let columns = &self.layout.columns;
            let stopped = columns.iter().enumerate().position(|(i, &column)| {
                let [low, high] = self.dynamics.parameters[column.parameter].bounds;
                let at = self.values.get(column);
                !held[i] && ((at <= low && step[i] < 0.0) || (at >= high && step[i] > 0.0))
            });
            match stopped {
                Some(i) => held[i] = true,
                None => return step,
            }
        }
    }

    fn finish(self) -> Fit {
        let terms = self.shooting.linearise(
            self.dynamics,
            self.tangent,
            &self.values,
            &self.locals,
            self.scale,
        );
        let shared = self.tangent.active.len();
        let reduced = (terms.iter().zip(&self.shooting.windows))
            .map(|(terms, window)| {
                let part = Eliminated::new(terms, shared, 0.0);
                Reduced {
                    columns: self.layout.places(window).to_vec(),
                    terms: WindowTerms {
                        cost: terms.cost,
                        gradient: part.gradient,
                        hessian: part.matrix,
                    },
                }
            })
            .collect();
        Fit {
            values: self.values.common,
            own: self.values.own,
            active: self.tangent.active.clone(),
            columns: self.layout.columns,
            locals: self.locals,
            scale: self.scale,
            cost: self.cost,
            reduced,
            iterations: self.iterations,
        }
    }
}

/// One window's normal equations with its own values eliminated.
struct Eliminated {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Own values = -(own^-1 gradient) - (own^-1 cross) shared step.
    local_gradient: DVector<f64>,
    local_cross: DMatrix<f64>,
    /// What the cost falls when the own values alone are adapted.
    own_gain: f64,
}

impl Eliminated {
    fn new(terms: &WindowTerms, shared: usize, damping: f64) -> Self {
        let locals = terms.gradient.len() - shared;
        let mut own = terms
            .hessian
            .view((shared, shared), (locals, locals))
            .into_owned();
        for i in 0..locals {
            own[(i, i)] += damping * own[(i, i)] + 1e-12;
        }
        let cross = terms
            .hessian
            .view((shared, 0), (locals, shared))
            .into_owned();
        let own_gradient = terms.gradient.rows(shared, locals).into_owned();
        let inverse = own.clone().cholesky().map_or_else(
            // Not positive definite: the window says nothing about its own values, which then stay.
            || DMatrix::zeros(locals, locals),
            |cholesky| cholesky.inverse(),
        );
        let local_gradient = &inverse * &own_gradient;
        let local_cross = &inverse * &cross;
        let matrix =
            terms.hessian.view((0, 0), (shared, shared)) - cross.transpose() * &local_cross;
        let gradient = terms.gradient.rows(0, shared) - cross.transpose() * &local_gradient;
        Self {
            matrix,
            gradient,
            own_gain: 0.5 * own_gradient.dot(&local_gradient),
            local_gradient,
            local_cross,
        }
    }

    fn local_step(&self, shared_step: &DVector<f64>) -> DVector<f64> {
        -(&self.local_gradient + &self.local_cross * shared_step)
    }
}

/// The solution with the held unknowns at zero.
fn solve_with_held(matrix: &DMatrix<f64>, right: &DVector<f64>, held: &[bool]) -> DVector<f64> {
    let free: Vec<usize> = (0..held.len()).filter(|&i| !held[i]).collect();
    let part = matrix.select_rows(&free).select_columns(&free);
    let mut step = DVector::zeros(held.len());
    if let Some(cholesky) = part.cholesky() {
        let solution = cholesky.solve(&right.select_rows(&free));
        for (&i, value) in free.iter().zip(solution.iter()) {
            step[i] = *value;
        }
    }
    step
}

/// Standard deviation of a normal sample with the same median absolute value; never zero.
fn robust_scale(residuals: impl Iterator<Item = f64>) -> f64 {
    let sizes: Vec<f64> = residuals.map(f64::abs).collect();
    (SIGMA_PER_MAD * upper_median(&sizes)).max(1e-6)
}
