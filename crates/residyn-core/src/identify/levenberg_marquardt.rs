use nalgebra::{DMatrix, DVector};

use super::normal_equations::{Normal, Reduced, WindowTerms, solve_with_held};
use super::outcome::{Fit, FitError, Termination};
use super::sensitivity::Tangent;
use super::shooting::Shooting;
use super::values::{Layout, Values};
use crate::data::statistics::{SIGMA_PER_MAD, upper_median};
use crate::model::Dynamics;

/// A fit for estimation ends when a step lowers the cost by less than this share.
const ENOUGH: f64 = 1e-6;
/// A fit at a given scale is for comparing models, which differ by more than this share of the cost or not at all.
const ENOUGH_TO_COMPARE: f64 = 1e-4;
/// A fit that is of use only below some cost is for choosing among sets of effects, which differ by more than this.
const ENOUGH_TO_CHOOSE: f64 = 1e-3;
/// Damping of the first step, as a share of the diagonal of the normal equations, and the factors by which it changes
/// with each step that lowers the cost and with each that does not.
const FIRST_DAMPING: f64 = 1e-3;
const DAMPING_ON_SUCCESS: f64 = 0.1;
const DAMPING_ON_FAILURE: f64 = 10.0;
/// A scale that changes by less than this share has settled.
const SETTLED: f64 = 0.01;
/// A fit that is of use only below some cost is given up if that cost is farther away than this many times the decrease
/// that the quadratic model predicts,
const OUT_OF_REACH: f64 = 3.0;
/// after this many steps: the first ones say little about where a search will end.
const FIRST_STEPS: usize = 3;
/// Below this range damping has no effect, and above it the step is shorter than rounding error.
const DAMPING_RANGE: [f64; 2] = [1e-12, 1e12];

/// A Levenberg-Marquardt search (Marquardt 1963) for the values of a model and the windows' own values.
pub(super) struct Search<'a> {
    shooting: &'a Shooting<'a>,
    dynamics: &'a Dynamics,
    tangent: &'a Tangent,
    layout: Layout,
    values: Values,
    start_states: Vec<Vec<f64>>,
    scale: f64,
    cost: f64,
    /// The share of the cost by which a step must lower it for another one to follow.
    enough: f64,
    /// A minimum that is not below this cost is of no use.
    below: f64,
    damping: f64,
    steps: usize,
    trace: Vec<f64>,
}

/// A step of all values at once.
struct Step {
    values: Values,
    start_states: Vec<Vec<f64>>,
}

impl<'a> Search<'a> {
    /// A search that starts at the model's values.
    ///
    /// # Errors
    /// No window, or a model that diverges there.
    pub fn new(
        shooting: &'a Shooting<'a>,
        dynamics: &'a Dynamics,
        tangent: &'a Tangent,
        start_states: Vec<Vec<f64>>,
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
            values: Values::of(dynamics, shooting.logs),
            start_states,
            scale: scale.unwrap_or(1.0),
            cost: f64::INFINITY,
            enough: scale.map_or(ENOUGH, |_| ENOUGH_TO_COMPARE),
            below: f64::INFINITY,
            damping: FIRST_DAMPING,
            steps: 0,
            trace: Vec::new(),
        };
        let costs = shooting.costs(dynamics, &search.values, &search.start_states, search.scale);
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

    /// Give up if the cost will not fall below this.
    pub fn only_below(mut self, cost: f64) -> Self {
        self.below = cost;
        self.enough = ENOUGH_TO_CHOOSE;
        self
    }

    /// Estimate the scale from the current residuals; returns whether it hardly changes.
    pub fn rescale(&mut self) -> bool {
        let before = self.scale;
        let residuals = self
            .shooting
            .residuals(self.dynamics, &self.values, &self.start_states);
        self.scale = robust_scale(residuals.into_iter().flatten());
        self.cost = self.total(&self.values, &self.start_states);
        self.damping = FIRST_DAMPING;
        (self.scale / before - 1.0).abs() < SETTLED
    }

    fn total(&self, values: &Values, start_states: &[Vec<f64>]) -> f64 {
        let costs = self
            .shooting
            .costs(self.dynamics, values, start_states, self.scale);
        costs.iter().sum::<f64>() + self.shooting.prior_cost(&self.layout.columns, values)
    }

    /// The part of the cost that is due to the values' distance from the declared ones.
    fn prior_cost(&self) -> f64 {
        self.shooting.prior_cost(&self.layout.columns, &self.values)
    }

    /// What it adds to the normal equations.
    fn prior_terms(&self) -> WindowTerms {
        self.shooting
            .prior_terms(&self.layout.columns, &self.values)
    }

    /// Take steps until none is worth taking, or until there have been `most`.
    pub fn run(&mut self, most: usize) -> Termination {
        while self.steps < most {
            let termination = self.step();
            self.trace.push(self.cost * self.scale * self.scale);
            if let Some(termination) = termination {
                return termination;
            }
        }
        Termination::StepLimit
    }

    /// Take one step that lowers the cost; returns why no other step is to follow, if so.
    fn step(&mut self) -> Option<Termination> {
        self.steps += 1;
        let terms = self.linearised();
        if self.steps > FIRST_STEPS && self.is_out_of_reach(&terms) {
            return Some(Termination::GivenUp);
        }
        let mut is_solvable = false;
        while self.damping < DAMPING_RANGE[1] {
            if let Some(Step {
                values,
                start_states,
            }) = self.propose(&terms)
            {
                is_solvable = true;
                let cost = self.total(&values, &start_states);
                if cost < self.cost {
                    let gain = (self.cost - cost) / self.cost.max(f64::MIN_POSITIVE);
                    (self.values, self.start_states, self.cost) = (values, start_states, cost);
                    self.damping = (self.damping * DAMPING_ON_SUCCESS).max(DAMPING_RANGE[0]);
                    return (gain <= self.enough).then_some(Termination::SmallDecrease);
                }
            }
            self.damping *= DAMPING_ON_FAILURE;
        }
        Some(if !is_solvable {
            Termination::Singular
        } else if self.predicts_enough(&terms) {
            Termination::NoDescent
        } else {
            Termination::SmallPredictedDecrease
        })
    }

    /// Whether the quadratic model of the cost predicts a decrease that would be worth another step. A loss below 1 is
    /// that of a single residual, so a share of it is no more than rounding error.
    fn predicts_enough(&mut self, terms: &[WindowTerms]) -> bool {
        self.damping = FIRST_DAMPING;
        let predicted = self.predicted_decrease(terms);
        predicted.is_none_or(|decrease| decrease > self.enough * self.cost.max(1.0))
    }

    /// Whether the quadratic model of the cost, hardly damped, leads nowhere near a useful cost.
    fn is_out_of_reach(&mut self, terms: &[WindowTerms]) -> bool {
        let below = self.below + self.prior_cost();
        if self.cost <= below {
            return false;
        }
        let damping = self.damping;
        self.damping = damping.min(FIRST_DAMPING);
        let predicted = self.predicted_decrease(terms);
        self.damping = damping;
        predicted.is_some_and(|decrease| self.cost - OUT_OF_REACH * decrease > below)
    }

    /// Predicted decrease of the cost by the next step; `None` if there is no such step.
    fn predicted_decrease(&self, terms: &[WindowTerms]) -> Option<f64> {
        let normal = self.normal(terms);
        let step = self.bounded_solution(&normal)?;
        Some(normal.predicted_decrease(&step)).filter(|decrease| decrease.is_finite())
    }

    /// The cost that the next step is predicted to reach; `None` if there is no such step.
    pub fn predicted_cost(&self) -> Option<f64> {
        let decrease = self.predicted_decrease(&self.linearised())?;
        Some(self.cost - decrease)
    }

    fn linearised(&self) -> Vec<WindowTerms> {
        self.shooting.linearise(
            self.dynamics,
            self.tangent,
            &self.values,
            &self.start_states,
            self.scale,
        )
    }

    fn normal(&self, terms: &[WindowTerms]) -> Normal {
        let (shared, layout) = (self.tangent.active.len(), &self.layout);
        let windows = &self.shooting.windows;
        let mut normal = Normal::new(terms, windows, layout, shared, self.damping);
        let declared = self.prior_terms();
        normal.gradient += declared.gradient;
        normal.matrix += declared.hessian;
        normal
    }

    fn propose(&self, terms: &[WindowTerms]) -> Option<Step> {
        let normal = self.normal(terms);
        let step = self.bounded_solution(&normal)?;
        let columns = &self.layout.columns;
        let values = self.values.moved(self.dynamics, columns, &step);
        let taken = columns
            .iter()
            .map(|&column| values.get(column) - self.values.get(column));
        let taken = DVector::from_iterator(step.len(), taken);
        let windows = normal.windows.iter().zip(&self.shooting.windows);
        let start_states = windows
            .zip(&self.start_states)
            .map(|((part, window), local)| {
                let step = part.local_step(&taken.select_rows(self.layout.places(window)));
                step.iter().zip(local).map(|(d, x)| x + d).collect()
            });
        Some(Step {
            start_states: start_states.collect(),
            values,
        })
    }

    /// The damped step, with parameters that a bound would stop removed one after the other.
    fn bounded_solution(&self, normal: &Normal) -> Option<DVector<f64>> {
        let matrix = self.damped(&normal.matrix);
        let right = -&normal.gradient;
        let mut held = vec![false; right.len()];
        loop {
            let step = solve_with_held(&matrix, &right, &held)?;
            let columns = &self.layout.columns;
            let stopped = columns.iter().enumerate().position(|(i, &column)| {
                let [low, high] = self.dynamics.parameters[column.parameter].bounds;
                let at = self.values.get(column);
                !held[i] && ((at <= low && step[i] < 0.0) || (at >= high && step[i] > 0.0))
            });
            match stopped {
                Some(i) => held[i] = true,
                None => return Some(step),
            }
        }
    }

    fn damped(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let mut matrix = matrix.clone();
        for (i, column) in self.layout.columns.iter().enumerate() {
            // Steps are damped against each parameter's own magnitude: a flat direction stays where it is.
            let floor = 1e-9 / self.dynamics.parameters[column.parameter].scale.powi(2);
            matrix[(i, i)] += self.damping * matrix[(i, i)] + floor;
        }
        matrix
    }

    /// The result of the search.
    pub fn finish(self, termination: Termination) -> (Values, Fit) {
        let terms = self.linearised();
        let windows = terms.iter().zip(&self.shooting.windows);
        let reduced = windows
            .map(|(terms, window)| Reduced::of(terms, self.layout.places(window)))
            .collect();
        let prior = self.prior_terms();
        let bodies = (self.shooting).declared_bodies(&self.layout.columns, &self.values);
        let fit = Fit {
            active: self.tangent.active.clone(),
            cost: self.cost - self.prior_cost(),
            prior_cost: self.prior_cost(),
            columns: self.layout.columns,
            start_states: self.start_states,
            scale: self.scale,
            prior,
            bodies,
            reduced,
            steps: self.steps,
            trace: self.trace,
            termination,
        };
        (self.values, fit)
    }
}

/// Standard deviation of a normal sample with the same median absolute value; never zero.
fn robust_scale(residuals: impl Iterator<Item = f64>) -> f64 {
    let sizes: Vec<f64> = residuals.map(f64::abs).collect();
    (SIGMA_PER_MAD * upper_median(&sizes)).max(1e-6)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Search, Termination};
    use crate::data::Log;
    use crate::identify::sensitivity::{Local, Tangent};
    use crate::identify::{FitError, Shooting, cut};
    use crate::model::{Dynamics, Model};

    /// One joint that follows `formula`, in which `k` starts at `value`.
    fn joint(formula: &str, value: f64) -> Dynamics {
        let text = format!(
            "[system]\nname = \"joint\"\njoints = 1\n[parameters]\nk = {{ value = {value} }}\n\
             [dynamics]\nqdd1 = \"{formula}\"\n"
        );
        let model = Model::from_text(Path::new("joint.toml"), &text, &[]).unwrap();
        model.with_smoothing_velocities(vec![0.0]).dynamics()
    }

    /// 4 s at 100 Hz of an acceleration of 2.
    fn log() -> Log {
        let time: Vec<f64> = (0..400).map(|row| 0.01 * f64::from(row)).collect();
        let mut log = Log::empty(1);
        log.q = vec![time.iter().map(|t| t * t).collect()];
        log.qd = vec![time.iter().map(|t| 2.0 * t).collect()];
        log.tau = vec![vec![0.0; time.len()]];
        log.time = time;
        log
    }

    /// How a fit of `k` with at most `most` steps ends, and the value that it finds.
    fn end(formula: &str, value: f64, most: usize) -> Result<(Termination, f64), FitError> {
        let (logs, dynamics) = ([log()], joint(formula, value));
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[1e-3]);
        let tangent = Tangent::new(&dynamics, &[0], Local::State);
        let start_states = shooting.initial_start_states(0);
        let mut search = Search::new(&shooting, &dynamics, &tangent, start_states, Some(1.0))?;
        let termination = search.run(most);
        let (found, fit) = search.finish(termination);
        assert_eq!(fit.termination, termination);
        Ok((termination, found.common[0]))
    }

    #[test]
    fn convergence_is_reported() {
        let (termination, k) = end("k", 1.0, 40).unwrap();
        assert!(termination.has_converged(), "{termination:?}");
        assert!((k - 2.0).abs() < 1e-6, "{k}");
    }

    #[test]
    fn a_fit_that_starts_at_the_minimum_has_converged() {
        let (termination, k) = end("k", 2.0, 40).unwrap();
        assert!(termination.has_converged(), "{termination:?}");
        assert!((k - 2.0).abs() < 1e-6, "{k}");
    }

    #[test]
    fn a_fit_that_reaches_the_step_limit_reports_it() {
        let (termination, k) = end("exp(k)", -3.0, 1).unwrap();
        assert_eq!(termination, Termination::StepLimit);
        assert!(!termination.has_converged() && k.exp() < 1.9, "{k}");
    }

    /// The square root has no derivative at zero: no step can be solved for, and none is taken in silence.
    #[test]
    fn normal_equations_that_are_not_finite_are_singular() {
        let (termination, k) = end("sqrt(k)", 0.0, 40).unwrap();
        assert_eq!((termination, k), (Termination::Singular, 0.0));
        assert!(!termination.has_converged());
    }

    /// The derivative at 1 points up to 2, but off 1 the model is far away on either side.
    #[test]
    fn a_fit_without_descent_is_reported_as_not_converged() {
        let (termination, k) = end("k + 100*abs(sign(k - 1))", 1.0, 40).unwrap();
        assert_eq!((termination, k), (Termination::NoDescent, 1.0));
        assert!(!termination.has_converged());
    }
}
