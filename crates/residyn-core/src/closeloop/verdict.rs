use super::diagnostics::{UNKNOWN, Unexplained};
use super::error_model::ErrorModel;
use super::establish::Chosen;
use super::gravity::against_gravity;
use super::judge::Found;
use super::plainer::Unused;
use super::problem::Problem;
use super::refine::Refined;
use super::score::Errors;
use crate::digits::{rounded, with_unit};
use crate::identify::Identifiability;
use crate::model::Parameter;
use schemars::JsonSchema;

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Effects were found and nothing significant is left.
    Explained,
    /// Effects were found and something significant is left.
    PartlyExplained,
    /// Something significant is missing and no effect of the library explains it.
    Unexplained,
    /// The declared model explains the logs.
    NoMissingEffect,
    /// The logs are too few or too poor to tell.
    Inconclusive,
}

/// The verdict and the reason for it, in a sentence.
pub(super) fn verdict(
    found: &Found<'_>,
    refined: &Refined<'_>,
    errors: &Errors,
) -> (Verdict, String) {
    let (verdict, reason) = concluded(found, refined, errors);
    let far = (found.problem.moves())
        .then(|| far_from_declared(&found.problem, refined))
        .flatten();
    let reasons = far
        .into_iter()
        .chain([reason])
        .chain(found.chosen.unused.iter().map(Unused::text));
    (verdict, reasons.collect::<Vec<_>>().join("; "))
}

fn concluded(found: &Found<'_>, refined: &Refined<'_>, errors: &Errors) -> (Verdict, String) {
    let problem = &found.problem;
    let added = problem.added(&found.chosen.after.model).len();
    let established = found.chosen.established();
    let [before, after] = errors.compared(problem.error_model);
    let are_worse = after > problem.settings.verdict.trusted_rise * before;
    match at_rest(problem)
        .or_else(|| failure(found, refined))
        .or_else(|| against_gravity(&found.gravity, &problem.settings.notes))
        .or_else(|| inconclusive(problem, &refined.identifiability, established))
    {
        Some(reason) => (Verdict::Inconclusive, reason),
        None if added > 0 && are_worse => contradicted(&found.chosen, &found.unexplained),
        None if found.chosen.stopped && established == 0 => {
            (Verdict::Inconclusive, format!("{STOPPED} than none"))
        }
        None if found.chosen.stopped => {
            let (verdict, reason) = conclusion(&found.chosen, &found.unexplained);
            (verdict, format!("{reason}; {STOPPED}"))
        }
        None => above_noise(
            conclusion(&found.chosen, &found.unexplained),
            problem,
            errors,
        ),
    }
}

/// A conclusion that nothing is left, if the error on the test logs is what the sensors' noise leaves; else that something
/// is, though no test of the residuals says what.
fn above_noise(
    (verdict, reason): (Verdict, String),
    problem: &Problem<'_>,
    errors: &Errors,
) -> (Verdict, String) {
    let most = problem.settings.verdict.noise_floors;
    let over = errors.over_noise().filter(|over| *over > most);
    match over.filter(|_| verdict == Verdict::Explained) {
        Some(over) => (
            Verdict::PartlyExplained,
            format!(
                "{reason}, but the error on the test logs is {over:.0} times what the noise of the sensors accounts for"
            ),
        ),
        None => (verdict, reason),
    }
}

const STOPPED: &str =
    "the search ran out of time, and with more time it may find a better set of effects";

/// Why nothing can be concluded from logs in which no joint moves.
fn at_rest(problem: &Problem<'_>) -> Option<String> {
    (!problem.moves())
        .then(|| "no joint moves visibly in any training log: record motion first".into())
}

/// Which fit that the verdict rests on failed or did not converge, if any.
fn failure(found: &Found<'_>, refined: &Refined<'_>) -> Option<String> {
    if let Some(error) = &found.chosen.failure {
        return Some(format!(
            "the effects selected on part of the training logs could not be fitted to all of them: {error}"
        ));
    }
    if let Some(error) = &refined.failure {
        return Some(format!(
            "the final fit in fine steps failed, and the values are those of the coarser fit: {error}"
        ));
    }
    let fit = &refined.after.fit;
    (!fit.termination.has_converged()).then(|| format!("the final fit has {}", fit.termination))
}

/// Values that the fit moves by more than this factor are not what the file means: a motion that says nothing of them,
/// another unit.
const FAR: f64 = 100.0;

/// The declared parameters that are fitted far from their declared values, as a reason to distrust the answer.
fn far_from_declared(problem: &Problem<'_>, refined: &Refined<'_>) -> Option<String> {
    // Moments and products of inertia have no size of their own: bodies stay physical.
    let of_bodies = problem.declared.inertias().concat();
    let declared = problem.declared.parameters.iter().enumerate();
    let declared = declared.filter(|(k, p)| p.bounds[0] >= 0.0 || !of_bodies.contains(k));
    let far = declared
        .map(|(k, declared)| (declared, &refined.after.model.parameters[k]))
        .filter(|(declared, fitted)| {
            let ratio = (fitted.value / declared.value).abs();
            // Nothing is odd about a moment or an offset that is nearly zero.
            let vanishes = ratio < 1.0 / FAR && declared.bounds[0] >= 0.0;
            !declared.fixed && declared.value != 0.0 && (vanishes || ratio > FAR)
        });
    let far: Vec<String> = far
        .map(|(declared, fitted)| {
            let amount =
                |of: &Parameter| with_unit(rounded(of.value, 0.01 * of.value.abs()), &of.unit);
            let [was, is] = [declared, fitted].map(amount);
            format!("{} is fitted at {is}, declared as {was}", fitted.name)
        })
        .collect();
    (!far.is_empty()).then(|| format!("{}: do not use this model", far.join(", ")))
}

/// Why the logs allow no conclusion, if they do not. Torques may establish a force although they say nothing of the
/// declared parameters.
fn inconclusive(
    problem: &Problem<'_>,
    known: &Identifiability,
    established: usize,
) -> Option<String> {
    let settings = &problem.settings.verdict;
    let windows = problem.shooting.windows.len();
    if windows < settings.fewest_windows {
        return Some(format!(
            "the training logs contain only {windows} windows of {} s; record more motion",
            problem.settings.fit.window_s
        ));
    }
    let tells_of_forces = problem.error_model == ErrorModel::InverseDynamics && established > 0;
    (known.free > 0 && known.determined == 0 && !tells_of_forces).then(|| {
        "the training logs determine none of the declared model's parameters; move the joints more"
            .into()
    })
}

/// The verdict on effects that raise the error on the test logs. Something is certainly missing if a significant
/// residual is left.
fn contradicted(chosen: &Chosen, left: &Unexplained) -> (Verdict, String) {
    let reason = "the effects lower the loss on left-out blocks of the training logs but raise the error on the test \
                  logs: do not use them until logs of more varied motion confirm them";
    if !left.is_significant() {
        return (Verdict::Inconclusive, reason.into());
    }
    let (verdict, _) = conclusion(chosen, left);
    (verdict, format!("{reason}; {}", what_is_left(left)))
}

fn what_is_left(left: &Unexplained) -> String {
    match left.place.as_str() {
        UNKNOWN => {
            "an unexplained residual remains and depends on none of the variables tested".to_owned()
        }
        place => format!("an unexplained residual remains and depends on {place}"),
    }
}

fn conclusion(chosen: &Chosen, left: &Unexplained) -> (Verdict, String) {
    let what_is_left = what_is_left(left);
    let nothing = match chosen.standings.is_empty() {
        true => "no effect in the library lowers the loss on left-out blocks",
        false => "none of the effects that lower the loss on left-out blocks is established",
    };
    match (chosen.established(), left.is_significant()) {
        (0, false) => (Verdict::NoMissingEffect, nothing.into()),
        (0, true) => {
            let reason = format!("{nothing}, and {what_is_left}");
            (Verdict::Unexplained, reason)
        }
        (_, false) => {
            let reason = "the effects found leave no significant residual";
            (Verdict::Explained, reason.into())
        }
        (_, true) => {
            let reason = format!("effects were found, but {what_is_left}");
            (Verdict::PartlyExplained, reason)
        }
    }
}
