use super::levenberg_marquardt::LevenbergMarquardt;
use super::outcome::{Fit, FitError, Led, Termination};
use super::search::{Purpose, Search};
use super::shooting::Shooting;
use super::solver::Solver;
use super::values::Values;
use crate::model::Dynamics;

/// Damping of the step whose worth is predicted, as a share of the diagonal of the normal equations.
const SCREENING_DAMPING: f64 = 1e-3;

/// Most estimates of the scale after the first fit; usually two or three suffice.
const MOST_SCALES: usize = 8;

/// Fit the parameters `active` of `dynamics` to the windows, starting from its values and `start_states`, with every window's
/// start state (and forces) free. `scale` fixes the scale of the residuals; without it, it is estimated by their median
/// absolute deviation as the fit proceeds. Returns the values found and how the fit ended.
///
/// # Errors
/// No window, or a model that diverges at the starting values. A fit that does not converge is not an error: its
/// [`Termination`] says so.
pub fn fit(
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    start_states: Vec<Vec<f64>>,
    scale: Option<f64>,
) -> Result<(Values, Fit), FitError> {
    let solver = &LevenbergMarquardt::USUAL;
    fit_by(solver, shooting, dynamics, active, start_states, scale)
}

/// As [`fit`], by any solver.
///
/// # Errors
/// As [`fit`].
pub fn fit_by(
    solver: &dyn Solver,
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    start_states: Vec<Vec<f64>>,
    scale: Option<f64>,
) -> Result<(Values, Fit), FitError> {
    let mut search = Search::new(shooting, dynamics, active, start_states, scale)?;
    let mut termination = solver.solve(&mut search);
    // The scale must be that of the final residuals; the smaller it is, the less the start states' estimates influence
    // them.
    for _ in 0..MOST_SCALES {
        if scale.is_some() || search.rescale() {
            break;
        }
        termination = solver.solve(&mut search);
    }
    Ok(search.finish(termination))
}

/// As [`fit_by`] at a given scale, if only a cost below `below` is of use; `None` if the cost does not reach it.
///
/// # Errors
/// As [`fit`].
pub fn fit_below(
    solver: &dyn Solver,
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    start_states: Vec<Vec<f64>>,
    (scale, below): (f64, f64),
) -> Result<Option<(Values, Fit)>, FitError> {
    let aim = (scale, below);
    let (search, termination) = led(solver, shooting, dynamics, active, start_states, aim)?;
    let is_of_use = search.cost() - search.prior_cost() < below;
    Ok(is_of_use.then(|| search.finish(termination)))
}

/// Where a solver leads the values at a given scale, if only a cost below `below` is of use: less than [`fit_below`] says,
/// and sooner. `None` if the solver gives up.
///
/// # Errors
/// As [`fit`].
pub fn led_below(
    solver: &dyn Solver,
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    start_states: Vec<Vec<f64>>,
    aim: (f64, f64),
) -> Result<Option<Led>, FitError> {
    let (search, termination) = led(solver, shooting, dynamics, active, start_states, aim)?;
    Ok((termination != Termination::GivenUp).then(|| search.led()))
}

/// A search at a given scale, with a cost in view, where a solver leads it.
fn led<'a>(
    solver: &dyn Solver,
    shooting: &'a Shooting<'a>,
    dynamics: &'a Dynamics,
    active: &[usize],
    start_states: Vec<Vec<f64>>,
    (scale, below): (f64, f64),
) -> Result<(Search<'a>, Termination), FitError> {
    let search = Search::new(shooting, dynamics, active, start_states, Some(scale))?;
    let mut search = search.to(Purpose::Choose { below });
    let termination = solver.solve(&mut search);
    Ok((search, termination))
}

/// Evaluate a model without changing a value: the normal equations of each window in the parameters `active`.
///
/// # Errors
/// As [`fit`].
pub fn as_it_stands(
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    start_states: Vec<Vec<f64>>,
    scale: f64,
) -> Result<Fit, FitError> {
    let search = Search::new(shooting, dynamics, active, start_states, Some(scale))?;
    let (_, fit) = search.finish(Termination::AsGiven);
    Ok(fit)
}

/// The cost that one Gauss-Newton step from the model's values is predicted to reach, within the parameters' bounds:
/// the worth of a candidate before it is fitted. `None` if the model diverges there or the step cannot be solved for.
pub fn predicted_cost(
    shooting: &Shooting<'_>,
    dynamics: &Dynamics,
    active: &[usize],
    start_states: &[Vec<f64>],
    scale: f64,
) -> Option<f64> {
    let start_states = start_states.to_vec();
    let search = Search::new(shooting, dynamics, active, start_states, Some(scale)).ok()?;
    let decrease = search.predicted_decrease(&search.linearised(), SCREENING_DAMPING)?;
    Some(search.cost() - decrease)
}
