//! Findings about the logs that only fitted models reveal, added to the logs' audits.

use super::diagnostics::residual_force;
use super::drive_gain::report_drive_gain;
use super::external_force::report_external_forces;
use super::fitted::Fitted;
use super::gravity::{report_gravity, shares_of_gravity};
use super::judge::Found;
use super::outcome::Diagnostics;
use super::prepare::Prepared;
use super::problem::Problem;
use super::refine::Refined;
use super::scale_told::{report_scale, report_scaled_limbs};
use super::select::is_of_too_many;
use crate::data::{Audit, Finding, Repeated, Severity, report_repeats};
use crate::model::Model;

/// What fitted models say of the logs.
pub(super) struct Noted {
    /// Of the training logs, then of the test logs: also torques that are reversed or hold another gravity, external
    /// forces, effects that are not looked for, values that share a factor, and logs that repeat others.
    pub audits: Vec<Audit>,
    /// Test logs that repeat training logs.
    pub fitted_tests: Vec<String>,
    /// What external forces in the training logs mean for the answer.
    pub pushed: Option<String>,
}

impl Noted {
    /// The reason for a verdict, after what makes it doubtful.
    pub fn before(&self, reason: String) -> String {
        match &self.pushed {
            Some(pushed) => format!("{pushed}; {reason}"),
            None => reason,
        }
    }
}

/// What fitted models say of the logs. `usual` is the declared model with the usual friction.
pub(super) fn noted(
    prepared: &Prepared<'_>,
    (found, refined): (&Found<'_>, &Refined<'_>),
    usual: Option<&Fitted>,
    diagnostics: &Diagnostics,
) -> Noted {
    let (problem, settings) = (&found.problem, &found.problem.settings.notes);
    let [mut of_train, mut of_test] =
        [&prepared.train, &prepared.test].map(|ready| ready.audits.clone());
    problem.report_reversed(usual, &mut of_train);
    report_gravity(&found.gravity, settings, &mut of_train);
    report_too_many(problem, &mut of_train);
    report_measured(problem, &mut of_train);
    report_drive_gain(problem.declared, &refined.after.model, &mut of_train);
    report_held(&refined.after.model, &mut of_train);
    report_scale(problem, &found.chosen.after, &mut of_train);
    report_scaled_limbs(problem, &refined.after.model, &mut of_train);
    // Logs on which the model diverges cannot show external forces.
    let residual = diagnostics.after.as_ref().ok();
    let model = &found.chosen.after.model;
    let pushed = residual.and_then(|residual| {
        report_external_forces(problem, model, &residual.samples, &mut of_train)
    });
    let tested = problem.on(&prepared.test.for_fits);
    report_gravity(&shares_of_gravity(&tested), settings, &mut of_test);
    if let Ok(forces) = residual_force(&tested, &found.chosen.after) {
        report_external_forces(&tested, model, &forces, &mut of_test);
    }
    let mut audits = [of_train, of_test].concat();
    report_unmatched(problem.declared, prepared, &mut audits);
    let fitted_tests = report_fitted_tests(prepared, &mut audits);
    Noted {
        audits,
        fitted_tests,
        pushed,
    }
}

/// Report in the first log's audit which values of effects are assumed, since the logs do not determine them.
fn report_held(fitted: &Model, audits: &mut [Audit]) {
    let parameters = fitted.all_parameters();
    for (k, effect) in fitted.effects.iter().enumerate() {
        let (Some(held), Some(audit)) = (effect.effect.held(), audits.first_mut()) else {
            continue;
        };
        let assumed = &parameters[fitted.place_of(k)][held];
        let text = format!(
            "{} = {:.3} {} of {} is assumed: the logs do not determine it, and its other values and the inertia of the \
             joint are those that go with it",
            assumed.name,
            assumed.value,
            assumed.unit,
            effect.label()
        );
        audit.add(Finding::new(Severity::Warning, text));
    }
}

/// Report in the audits which logs repeat each other; returns the test logs that repeat training logs.
fn report_fitted_tests(prepared: &Prepared<'_>, audits: &mut [Audit]) -> Vec<String> {
    let (train, test) = (&prepared.train.logs, &prepared.test.logs);
    let repeated = report_repeats(train.iter().chain(&**test), audits);
    let of_test = test.iter().zip(&repeated[train.len()..]);
    let is_fitted = |repeated: &Repeated| repeated.is_identical() && repeated.place < train.len();
    let fitted = of_test.filter(|(_, repeated)| repeated.as_ref().is_some_and(is_fitted));
    fitted.map(|(log, _)| log.name()).collect()
}

/// Report in the first log's audit which tables of the model file speak of none of the logs.
fn report_unmatched(declared: &Model, prepared: &Prepared<'_>, audits: &mut [Audit]) {
    let logs = (prepared.train.logs.iter()).chain(&*prepared.test.logs);
    for pattern in declared.unmatched(logs) {
        let text = format!(
            "[logs.{pattern:?}] of the model file matches none of the logs: it is compared with their file names"
        );
        if let Some(audit) = audits.first_mut() {
            audit.add(Finding::new(Severity::Warning, text));
        }
    }
}

/// Report in the first log's audit what is not looked for because of further measured columns: effects that read some
/// that the model does not declare, and the residual network.
fn report_measured(problem: &Problem<'_>, audits: &mut [Audit]) {
    let Some(audit) = audits.first_mut() else {
        return;
    };
    let own: Vec<&str> = problem.declared.measured_names().collect();
    for effect in problem.library.effects() {
        if let Some(column) = effect.measured().find(|name| !own.contains(name)) {
            let text = format!(
                "{} is not searched for: it reads `{column}`, which the model file does not declare under [measured]",
                effect.name
            );
            audit.add(Finding::new(Severity::Warning, text));
        }
    }
    if !own.is_empty() {
        let text = format!(
            "no residual network is trained: networks read states and torques alone, and the model reads {}",
            own.join(", ")
        );
        audit.add(Finding::new(Severity::Info, text));
    }
}

/// Report in the first log's audit which effects are not looked for because there are too many logs.
fn report_too_many(problem: &Problem<'_>, audits: &mut [Audit]) {
    let Some(audit) = audits.first_mut() else {
        return;
    };
    let effects = problem.effects().iter();
    for effect in effects.filter(|effect| is_of_too_many(problem, effect)) {
        let text = format!(
            "{} has one value per log and is not searched for in {} logs, only in up to {}: give fewer logs if they \
             may differ in it",
            effect.name,
            problem.logs.len(),
            problem.settings.select.most_logs_of_own_values
        );
        audit.add(Finding::new(Severity::Warning, text));
    }
}
