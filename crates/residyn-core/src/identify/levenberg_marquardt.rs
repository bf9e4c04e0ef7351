use super::outcome::Termination;
use super::search::{Linearised, Purpose, Search};
use super::solver::Solver;

/// The method of Levenberg and Marquardt (Marquardt 1963): Gauss-Newton steps, damped until they lower the cost.
#[derive(Debug, Clone, PartialEq)]
pub struct LevenbergMarquardt {
    /// Most steps of one fit; Gauss-Newton on such problems needs 3 to 30.
    pub most_steps: usize,
    /// A fit for estimation ends when a step lowers the cost by less than this share.
    pub enough_to_estimate: f64,
    /// The same for comparing models, which differ by more than this share of the cost or not at all.
    pub enough_to_compare: f64,
    /// The same for choosing among sets of effects, which differ by more than this.
    pub enough_to_choose: f64,
    /// Where no step lowers the cost, a fit has converged if the quadratic model predicts a decrease below this as well:
    /// it would move no combination of the values by a fifth of its standard error.
    pub negligible: f64,
    /// Damping of the first step, as a share of the diagonal of the normal equations.
    pub first_damping: f64,
    /// The factor by which damping changes with each step that lowers the cost.
    pub damping_on_success: f64,
    /// The factor by which it changes with each step that does not.
    pub damping_on_failure: f64,
    /// Below this range damping has no effect, and above it the step is shorter than rounding error.
    pub damping_range: [f64; 2],
    /// A fit for choosing is given up if the cost of use is farther away than this many times the decrease that the
    /// quadratic model predicts.
    pub out_of_reach: f64,
    /// It is given up only after this many steps: the first ones say little about where a search will end.
    pub first_steps: usize,
}

impl LevenbergMarquardt {
    /// The values with which fits run unless a request says otherwise.
    pub const USUAL: Self = Self {
        most_steps: 400,
        enough_to_estimate: 1e-6,
        enough_to_compare: 1e-4,
        enough_to_choose: 1e-3,
        negligible: 0.02,
        first_damping: 1e-3,
        damping_on_success: 0.1,
        damping_on_failure: 10.0,
        damping_range: [1e-12, 1e12],
        out_of_reach: 3.0,
        first_steps: 3,
    };
}

impl Solver for LevenbergMarquardt {
    fn solve(&self, search: &mut Search<'_>) -> Termination {
        let mut damping = self.first_damping;
        let mut gain = 1.0;
        while search.steps() < self.most_steps {
            let before = search.cost();
            let termination = self.step(search, &mut damping);
            search.end_step();
            if let Some(termination) = termination {
                return termination;
            }
            gain = (before - search.cost()) / before.max(f64::MIN_POSITIVE);
        }
        // In a long valley the last steps may lower the cost by less than models can differ by.
        match gain <= self.enough_to_compare {
            true => Termination::SmallDecrease,
            false => Termination::StepLimit,
        }
    }
}

impl LevenbergMarquardt {
    /// Take one step that lowers the cost; returns why no other step is to follow, if so.
    fn step(&self, search: &mut Search<'_>, damping: &mut f64) -> Option<Termination> {
        let (near, enough) = (search.linearised(), self.enough(search.purpose()));
        if search.steps() >= self.first_steps && self.is_out_of_reach(search, &near, *damping) {
            return Some(Termination::GivenUp);
        }
        let mut is_solvable = false;
        while *damping < self.damping_range[1] {
            if let Some(step) = search.propose(&near, *damping) {
                is_solvable = true;
                let (before, after) = (search.cost(), search.cost_of(&step));
                if after < before {
                    search.take(step, after);
                    *damping = (*damping * self.damping_on_success).max(self.damping_range[0]);
                    let gain = (before - after) / before.max(f64::MIN_POSITIVE);
                    return (gain <= enough).then_some(Termination::SmallDecrease);
                }
            }
            *damping *= self.damping_on_failure;
        }
        Some(if !is_solvable {
            Termination::Singular
        } else if self.predicts_enough(search, &near) {
            Termination::NoDescent
        } else {
            Termination::SmallPredictedDecrease
        })
    }

    /// The share of the cost by which a step must lower it for another one to follow.
    fn enough(&self, purpose: Purpose) -> f64 {
        match purpose {
            Purpose::Estimate => self.enough_to_estimate,
            Purpose::Compare => self.enough_to_compare,
            Purpose::Choose { .. } => self.enough_to_choose,
        }
    }

    /// Whether the quadratic model of the cost predicts a decrease that would be worth another step. A loss below 1 is
    /// that of a single residual, so a share of it is no more than rounding error.
    fn predicts_enough(&self, search: &Search<'_>, near: &Linearised) -> bool {
        let predicted = search.predicted_decrease(near, self.first_damping);
        let enough = self.enough(search.purpose()) * search.cost().max(1.0);
        predicted.is_none_or(|decrease| decrease > enough.max(self.negligible))
    }

    /// Whether the quadratic model of the cost, hardly damped, leads nowhere near a useful cost.
    fn is_out_of_reach(&self, search: &Search<'_>, near: &Linearised, damping: f64) -> bool {
        let Purpose::Choose { below } = search.purpose() else {
            return false;
        };
        let below = below + search.prior_cost();
        if search.cost() <= below {
            return false;
        }
        let predicted = search.predicted_decrease(near, damping.min(self.first_damping));
        predicted.is_some_and(|decrease| search.cost() - self.out_of_reach * decrease > below)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{LevenbergMarquardt, Search, Solver, Termination};
    use crate::data::Log;
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
        let start_states = shooting.initial_start_states(0);
        let mut search = Search::new(&shooting, &dynamics, &[0], start_states, Some(1.0))?;
        let solver = LevenbergMarquardt {
            most_steps: most,
            ..LevenbergMarquardt::USUAL
        };
        let termination = solver.solve(&mut search);
        let (found, fit) = search.finish(termination);
        assert_eq!(fit.termination, termination);
        Ok((termination, found.common[0]))
    }

    #[test]
    fn a_fit_that_ends_or_starts_at_the_minimum_has_converged() {
        for start in [1.0, 2.0] {
            let (termination, k) = end("k", start, 40).unwrap();
            assert!(termination.has_converged(), "{termination:?}");
            assert!((k - 2.0).abs() < 1e-6, "{k}");
        }
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
