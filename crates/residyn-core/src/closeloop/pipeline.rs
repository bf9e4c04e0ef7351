//! Closing the loop, stage by stage, as `docs/method.md` describes it.

use rand::Rng;

use super::alike::{Part, agree};
use super::command_path;
use super::discriminate::discriminate;
use super::error::StudyError;
use super::fit::{Declared, fit};
use super::judge::Found;
use super::learn::learn;
use super::limbs::find_in_limbs;
use super::notes::noted;
use super::outcome::{Diagnostics, Effects, Given, Models, Outcome};
use super::prepare::{Prepared, prepare};
use super::refine::refine;
use super::request::Request;
use super::score::score;
use super::stage::Watch;
use crate::data::{Joint, Log};

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
    let limbs = found.problem.limbs_by_motion();
    found.decide_by_motion(&limbs);
    found.add_friction_by_motion(&limbs);
    let alternatives = discriminate(&found, watch);
    let mut refined = refine(&found, watch);
    refined.estimate_by_motion(&limbs);
    refined.tie();
    found.chosen.confirm(&mut refined);
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
/// `apart`, to which nothing is fitted. Like joints have like effects unless the logs say otherwise.
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
    let whole = declared.problem.declared;
    let searched = command_path::searched(declared, apart, rng, watch)?;
    let joints = Joint::all(whole.joints).collect();
    let mut parts = [Part { joints, searched }];
    agree(whole, &mut parts, watch);
    let [Part { searched, .. }] = parts;
    Ok(searched.judged(apart, rng))
}
