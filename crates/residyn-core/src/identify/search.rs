use nalgebra::{DMatrix, DVector};

use super::active_set::step_within_bounds;
use super::normal_equations::{Normal, Reduced, WindowTerms, solve_part};
use super::outcome::{Fit, FitError, Led, Termination};
use super::sensitivity::Tangent;
use super::shooting::Shooting;
use super::values::{Layout, Values};
use crate::data::statistics::{SIGMA_PER_MAD, upper_median};
use crate::model::Dynamics;

/// A scale that changes by less than this share has settled.
const SETTLED: f64 = 0.01;

/// A search for the values of a model, and the windows' own values, at which the cost of a fit is least. A
/// [`Solver`](super::Solver) moves it.
pub struct Search<'a> {
    shooting: &'a Shooting<'a>,
    dynamics: &'a Dynamics,
    tangent: Tangent,
    layout: Layout,
    at: Point,
    scale: f64,
    cost: f64,
    purpose: Purpose,
    steps: usize,
    trace: Vec<f64>,
}

/// Values of a model and of the windows.
struct Point {
    values: Values,
    start_states: Vec<Vec<f64>>,
}

/// A step of all values at once, not yet taken.
pub struct Step(Point);

/// The cost as a quadratic function of all values near a point.
pub struct Linearised(Vec<WindowTerms>);

/// What the minimum is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Purpose {
    /// The values: the scale of the residuals is estimated as well.
    Estimate,
    /// To compare models at a given scale: their costs differ by a visible share or not at all.
    Compare,
    /// To choose among sets of effects: a minimum that is not below this cost is of no use.
    Choose { below: f64 },
}

impl<'a> Search<'a> {
    /// A search for the parameters `active` that starts at the model's values.
    ///
    /// # Errors
    /// No window, or a model that diverges there.
    pub(super) fn new(
        shooting: &'a Shooting<'a>,
        dynamics: &'a Dynamics,
        active: &[usize],
        start_states: Vec<Vec<f64>>,
        scale: Option<f64>,
    ) -> Result<Self, FitError> {
        if shooting.windows.is_empty() {
            return Err(FitError::NoWindow);
        }
        let values = Values::of(dynamics, shooting.logs);
        let mut search = Self {
            shooting,
            dynamics,
            tangent: Tangent::new(dynamics, active, shooting.local(&start_states)),
            layout: Layout::new(&dynamics.parameters, active, &shooting.windows, &values),
            at: Point {
                values,
                start_states,
            },
            scale: scale.unwrap_or(1.0),
            cost: f64::INFINITY,
            purpose: scale.map_or(Purpose::Estimate, |_| Purpose::Compare),
            steps: 0,
            trace: Vec::new(),
        };
        let costs = search.costs(&search.at);
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
            search.cost = costs.iter().sum::<f64>() + search.prior_cost();
        }
        Ok(search)
    }

    /// The same search for another purpose.
    pub(super) fn to(mut self, purpose: Purpose) -> Self {
        self.purpose = purpose;
        self
    }

    /// What the minimum is for.
    pub fn purpose(&self) -> Purpose {
        self.purpose
    }

    /// Number of steps done.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The cost at the present values: the sum of the windows' Huber losses and the prior's part.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// The part of the cost that is due to the values' distance from the declared ones.
    pub fn prior_cost(&self) -> f64 {
        let columns = &self.layout.columns;
        self.shooting.prior_cost(columns, &self.at.values)
    }

    /// The cost after a step; not finite if the model diverges.
    pub fn cost_of(&self, step: &Step) -> f64 {
        self.cost_at(&step.0)
    }

    fn cost_at(&self, point: &Point) -> f64 {
        let prior = (self.shooting).prior_cost(&self.layout.columns, &point.values);
        self.costs(point).iter().sum::<f64>() + prior
    }

    /// The loss of each window.
    fn costs(&self, at: &Point) -> Vec<f64> {
        (self.shooting).costs(self.dynamics, &at.values, &at.start_states, self.scale)
    }

    /// Take a step that has this cost.
    pub fn take(&mut self, Step(point): Step, cost: f64) {
        (self.at, self.cost) = (point, cost);
    }

    /// Count a step, taken or not, and record the cost after it.
    pub fn end_step(&mut self) {
        self.steps += 1;
        self.trace.push(self.cost * self.scale * self.scale);
    }

    /// Estimate the scale from the present residuals; returns whether it hardly changes.
    pub(super) fn rescale(&mut self) -> bool {
        let (before, at) = (self.scale, &self.at);
        let residuals = (self.shooting).residuals(self.dynamics, &at.values, &at.start_states);
        self.scale = robust_scale(residuals.into_iter().flatten());
        self.cost = self.cost_at(&self.at);
        (self.scale / before - 1.0).abs() < SETTLED
    }

    /// The cost near the present values.
    pub fn linearised(&self) -> Linearised {
        let Point {
            values,
            start_states,
        } = &self.at;
        let (dynamics, tangent) = (self.dynamics, &self.tangent);
        let terms = self
            .shooting
            .linearise(dynamics, tangent, values, start_states, self.scale);
        Linearised(terms)
    }

    /// The damped Gauss-Newton step within the parameters' bounds; `damping` is a share of the diagonal of the normal
    /// equations. `None` if they are not positive definite or not finite.
    pub fn propose(&self, near: &Linearised, damping: f64) -> Option<Step> {
        let normal = self.normal(near, damping);
        let step = self.bounded_solution(&normal, damping)?;
        let columns = &self.layout.columns;
        let values = self.at.values.moved(self.dynamics, columns, &step);
        let taken = columns
            .iter()
            .map(|&column| values.get(column) - self.at.values.get(column));
        let taken = DVector::from_iterator(step.len(), taken);
        let windows = normal.windows.iter().zip(&self.shooting.windows);
        let start_states = windows
            .zip(&self.at.start_states)
            .map(|((own, window), local)| {
                let step = own.step(&taken.select_rows(self.layout.places(window)));
                step.iter().zip(local).map(|(d, x)| x + d).collect()
            });
        Some(Step(Point {
            start_states: start_states.collect(),
            values,
        }))
    }

    /// By how much the quadratic cost falls with that step; `None` if there is no such step.
    pub fn predicted_decrease(&self, near: &Linearised, damping: f64) -> Option<f64> {
        let normal = self.normal(near, damping);
        let step = self.bounded_solution(&normal, damping)?;
        Some(normal.predicted_decrease(&step)).filter(|decrease| decrease.is_finite())
    }

    fn normal(&self, Linearised(terms): &Linearised, damping: f64) -> Normal {
        let (shared, layout) = (self.tangent.active.len(), &self.layout);
        let mut normal = Normal::new(terms, &self.shooting.windows, layout, shared, damping);
        let declared = self.prior_terms();
        normal.gradient += declared.gradient;
        normal.matrix += declared.hessian;
        normal
    }

    /// What the distance from the declared values adds to the normal equations.
    fn prior_terms(&self) -> WindowTerms {
        let columns = &self.layout.columns;
        self.shooting.prior_terms(columns, &self.at.values)
    }

    /// The damped step, where parameters that a bound would stop stay.
    fn bounded_solution(&self, normal: &Normal, damping: f64) -> Option<DVector<f64>> {
        let matrix = self.damped(&normal.matrix, damping);
        let right = -&normal.gradient;
        let leaves = |i: usize, step: f64| {
            let column = self.layout.columns[i];
            let [low, high] = self.dynamics.parameters[column.parameter].bounds;
            let at = self.at.values.get(column);
            (at <= low && step < 0.0) || (at >= high && step > 0.0)
        };
        let all = (0..right.len()).collect();
        let solve = |free: &[usize]| solve_part(&matrix, &right, free);
        let (free, part) = step_within_bounds(all, solve, leaves)?;
        let mut step = DVector::zeros(right.len());
        for (&i, value) in free.iter().zip(part.iter()) {
            step[i] = *value;
        }
        Some(step)
    }

    fn damped(&self, matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
        let mut matrix = matrix.clone();
        for (i, column) in self.layout.columns.iter().enumerate() {
            // Steps are damped against each parameter's own magnitude: a flat direction stays where it is.
            let floor = 1e-9 / self.dynamics.parameters[column.parameter].scale.powi(2);
            matrix[(i, i)] += damping * matrix[(i, i)] + floor;
        }
        matrix
    }

    /// Where the search has led.
    pub(super) fn led(self) -> Led {
        Led {
            cost: self.cost - self.prior_cost(),
            values: self.at.values,
            start_states: self.at.start_states,
        }
    }

    /// The result of the search.
    pub(super) fn finish(self, termination: Termination) -> (Values, Fit) {
        let Linearised(terms) = self.linearised();
        let windows = terms.iter().zip(&self.shooting.windows);
        let reduced = windows
            .map(|(terms, window)| Reduced::of(terms, self.layout.places(window)))
            .collect();
        let (prior, prior_cost) = (self.prior_terms(), self.prior_cost());
        let Point {
            values,
            start_states,
        } = self.at;
        let bodies = (self.shooting).declared_bodies(&self.layout.columns, &values);
        let fit = Fit {
            active: self.tangent.active,
            cost: self.cost - prior_cost,
            prior_cost,
            columns: self.layout.columns,
            start_states,
            scale: self.scale,
            prior,
            bodies,
            reduced,
            steps: self.steps,
            trace: self.trace,
            termination,
        };
        (values, fit)
    }
}

/// Standard deviation of a normal sample with the same median absolute value, over the residuals that count; never zero.
fn robust_scale(residuals: impl Iterator<Item = f64>) -> f64 {
    let counting = residuals.filter(|residual| *residual != 0.0);
    let sizes: Vec<f64> = counting.map(f64::abs).collect();
    (SIGMA_PER_MAD * upper_median(&sizes)).max(1e-6)
}
