//! Closing the loop, stage by stage, as `docs/method.md` describes it.

use rand::Rng;

use super::diagnostics::diagnose;
use super::discriminate::discriminate;
use super::error::StudyError;
use super::error_model::ErrorModel;
use super::establish::{Chosen, establish};
use super::fit::{Declared, fit};
use super::judge::{Found, judge};
use super::learn::learn;
use super::limbs::find_in_limbs;
use super::loss::Loss;
use super::notes::noted;
use super::outcome::{Diagnostics, Effects, Given, Models, Outcome};
use super::plainer::{Plainer, plainer};
use super::prepare::{Prepared, prepare};
use super::refine::refine;
use super::request::Request;
use super::score::score;
use super::select::{Selected, Trial, select, select_from};
use super::stage::{Stage, Watch};
use crate::data::Log;

/// Fit the declared model, add effects while they lower the loss on blocks left out of the fit, train the residual
/// network on what is left, and score the models before and after on the test logs.
///
/// # Errors
/// Logs without a usable window, logs that lack a measured column, or a declared model that diverges from its starting
/// values.
pub fn close_loop(
    request: Request<'_>,
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Outcome, StudyError> {
    request.check_measured()?;
    solve(&prepare(request, watch), rng, watch)
}

/// The same, with prepared logs.
///
/// # Errors
/// As [`close_loop`].
pub fn solve(
    prepared: &Prepared<'_>,
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Outcome, StudyError> {
    let declared = fit(prepared, watch)?;
    let mut found = find(declared, &prepared.test.for_fits, rng, watch)?;
    let alternatives = discriminate(&found, watch);
    let mut refined = refine(&found, watch);
    found.chosen.confirm(&mut refined);
    refined.estimate_by_motion();
    let diagnostics = Diagnostics::of(&found, &refined);
    let with_friction = found.problem.with_usual_friction();
    let noted = noted(
        prepared,
        (&found, &refined),
        with_friction.as_ref(),
        &diagnostics,
    );
    let learned = learn(&refined, prepared.learner, rng, watch);
    let rivals = (with_friction.as_ref(), learned.as_ref());
    let scores = score(prepared, &found, &refined, rivals, rng, watch);
    Ok(Outcome {
        error_model: found.problem.error_model,
        verdict: scores.verdict,
        reason: noted.before(scores.reason),
        given: Given::of(prepared, noted),
        models: Models::of(&found.problem, refined),
        effects: Effects::of(scores.findings, alternatives, found.chosen),
        diagnostics,
        errors: scores.errors,
        predictions: scores.predictions,
        learned,
        by_log: scores.by_log,
        calibration: None,
        seconds: Vec::new(),
    })
}

/// Search the logs for what the declared model lacks: select the set of effects that explains them best, judge each
/// effect, and test the residuals. If torques are compared, an effect must also improve the fit of the logs set
/// `apart`, to which nothing is fitted.
///
/// # Errors
/// As [`Problem::fit_declared`](super::Problem::fit_declared).
pub fn find<'a>(
    declared: Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Found<'a>, StudyError> {
    if let Some(found) = find_in_limbs(&declared, apart, rng, watch)? {
        return Ok(found);
    }
    let mut best = Searched::of(declared, watch);
    if let Some(slower) = best.with_slower_reversals(watch)? {
        best = slower;
    }
    watch.see(Stage::Diagnostics.into());
    let mut left = best.diagnose(rng);
    if (left.is_significant() || best.chosen.failure.is_some())
        && let Some(other) = best.searched_again(watch)
    {
        best = other;
        left = best.diagnose(rng);
    }
    let mut is_plainer = false;
    while let Some(plainer) = best.plainer(apart, watch) {
        (best, is_plainer) = (plainer, true);
    }
    if is_plainer {
        left = best.diagnose(rng);
    }
    Ok(judge(best.declared, best.chosen, left, apart, rng))
}

/// A search for effects, and the fit that it began with.
struct Searched<'a> {
    declared: Declared<'a>,
    chosen: Chosen,
}

impl<'a> Searched<'a> {
    fn of(declared: Declared<'a>, watch: &dyn Watch) -> Self {
        let Declared { problem, fitted } = &declared;
        let selected = select(problem, fitted, watch);
        let chosen = establish(problem, fitted, selected, watch);
        Self { declared, chosen }
    }

    /// The search with wider smoothing velocities, if its loss is lower.
    fn with_slower_reversals(&self, watch: &dyn Watch) -> Result<Option<Self>, StudyError> {
        let problem = &self.declared.problem;
        let Some((widths, narrowest)) = problem.wider_reversal(&self.chosen.after, watch) else {
            return Ok(None);
        };
        let declared = problem.with_smoothing_velocities(widths).fit_declared()?;
        let other = Self::of(declared, watch);
        Ok((other.loss() < narrowest).then_some(other))
    }

    /// A search that begins over short windows and from the declared values, if its loss is lower: with most of the
    /// force missing, fits over longer windows end in minima from which no set of effects looks right, and at which
    /// other parameters seem undetermined.
    fn searched_again(&self, watch: &dyn Watch) -> Option<Self> {
        let Declared { problem, fitted } = &self.declared;
        if problem.error_model == ErrorModel::InverseDynamics || watch.has_to_end() {
            return None;
        }
        let short = problem.fitted_over_short_windows().ok()?;
        let problem = problem.knowing(short.problem.identifiability.clone());
        let selected = select_from(&problem, &short, watch);
        let chosen = establish(&problem, fitted, selected, watch);
        let fitted = fitted.clone();
        let declared = Declared { problem, fitted };
        let other = Self { declared, chosen };
        (!other.chosen.standings.is_empty() && other.loss() < self.loss()).then_some(other)
    }

    /// The same search with a plainer model in place of the chosen one, if it predicts whole logs better.
    fn plainer(&self, apart: &[Log], watch: &dyn Watch) -> Option<Self> {
        let Declared { problem, fitted } = &self.declared;
        let Plainer {
            fitted: plain,
            unused,
        } = plainer(problem, fitted, &self.chosen, apart)?;
        let selected = Selected {
            chosen: Ok(Trial::of(problem, plain)),
            usual: self.chosen.usual.clone(),
            rounds: self.chosen.rounds.clone(),
            stopped: self.chosen.stopped,
        };
        let chosen = Chosen {
            unused: [self.chosen.unused.as_slice(), &[unused]].concat(),
            ..establish(problem, fitted, selected, watch)
        };
        let declared = self.declared.clone();
        Some(Self { declared, chosen })
    }

    fn loss(&self) -> f64 {
        Loss::of(&self.declared.problem, &self.chosen.after).total()
    }

    fn diagnose(&self, rng: &mut impl Rng) -> super::diagnostics::Unexplained {
        let Declared { problem, fitted } = &self.declared;
        diagnose(problem, fitted, &self.chosen.after, rng)
    }
}
