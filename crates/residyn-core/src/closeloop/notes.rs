//! What only fitted models tell of the logs, added to their audits.

use super::fitted::Fitted;
use super::gravity::{shares_of_gravity, tell_gravity};
use super::judge::Found;
use super::outcome::Remainder;
use super::prepare::Prepared;
use super::problem::Problem;
use super::pushes::tell_pushes;
use super::remainder::residual_force;
use super::select::is_of_too_many;
use crate::data::{Audit, Finding, Repeated, Severity, tell_repeats};

/// The audits of the training logs, then of the test logs, with what the models say: torques that are reversed or hold another
/// gravity, pushes, effects that are not looked for, and logs that repeat others; and the test logs that are training logs once
/// more. `usual` is the declared model with the usual friction.
pub(super) fn noted(
    prepared: &Prepared<'_>,
    found: &Found<'_>,
    usual: Option<&Fitted>,
    remainder: &Remainder,
) -> (Vec<Audit>, Vec<String>) {
    let problem = &found.problem;
    let [mut of_train, mut of_test] =
        [&prepared.train, &prepared.test].map(|ready| ready.audits.clone());
    problem.tell_reversed(usual, &mut of_train);
    tell_gravity(&found.gravity, &problem.settings.notes, &mut of_train);
    tell_too_many(problem, &mut of_train);
    // A model that diverges over the logs has no residual force to see a push in.
    if let Ok(residual) = &remainder.after {
        tell_pushes(problem, &residual.samples, &mut of_train);
    }
    let tested = problem.on(&prepared.test.for_fits);
    tell_gravity(
        &shares_of_gravity(&tested),
        &problem.settings.notes,
        &mut of_test,
    );
    if let Ok(forces) = residual_force(&tested, &found.chosen.after) {
        tell_pushes(&tested, &forces, &mut of_test);
    }
    let mut audits = [of_train, of_test].concat();
    let fitted_tests = tell_fitted_tests(prepared, &mut audits);
    (audits, fitted_tests)
}

/// Say in the audits which logs repeat each other; the test logs that are training logs once more.
fn tell_fitted_tests(prepared: &Prepared<'_>, audits: &mut [Audit]) -> Vec<String> {
    let (train, test) = (&prepared.train.logs, &prepared.test.logs);
    let repeated = tell_repeats(train.iter().chain(&**test), audits);
    let of_test = test.iter().zip(&repeated[train.len()..]);
    let is_fitted = |repeated: &Repeated| repeated.is_identical() && repeated.place < train.len();
    of_test
        .filter(|(_, repeated)| repeated.as_ref().is_some_and(is_fitted))
        .map(|(log, _)| log.name())
        .collect()
}

/// Say in the audit of the first log which effects are not looked for because there are too many logs.
fn tell_too_many(problem: &Problem<'_>, audits: &mut [Audit]) {
    let Some(audit) = audits.first_mut() else {
        return;
    };
    let effects = problem.effects().iter();
    for effect in effects.filter(|effect| is_of_too_many(problem, effect)) {
        let text = format!(
            "{} has a value for each log and is not looked for in {} logs, but in at most {}: give fewer if the logs may differ by it",
            effect.name,
            problem.logs.len(),
            problem.settings.select.most_logs_of_own_values
        );
        audit.add(Finding::new(Severity::Warning, text));
    }
}
