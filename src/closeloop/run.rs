use std::time::Instant;

use rand::Rng;

use super::discriminate::discriminate;
use super::error::StudyError;
use super::find::{Found, find};
use super::gravity::{shares_of_gravity, tell_gravity};
use super::learn::learn;
use super::outcome::{Effects, Given, Models, Outcome, Remainder};
use super::pushes::tell_pushes;
use super::refine::{Refined, refine};
use super::remainder::{ResidualForce, proposal, residual_force};
use super::request::Request;
use super::score::{Scored, Scorer, contradicted, findings};
use super::select::is_of_too_many;
use super::space::Space;
use super::split::Split;
use super::stage::{Clock, Observer, Progress, Stage};
use super::study::Study;
use super::verdict::verdict;
use crate::data::{Audit, Finding, Log, Repeated, Severity, audit_together, tell_repeats};
use crate::limits::FITTED_PARAMETERS;
use crate::model::{Library, Status};

/// Fit the declared model, add effects while they lower the loss on stretches left out of the fit, train the residual
/// network on the remainder, and score the models before and after on the test logs.
///
/// # Errors
/// Logs without a usable window, or a declared model that diverges from its starting values.
pub fn close_loop(
    mut request: Request<'_>,
    rng: &mut impl Rng,
    progress: &mut Observer<'_>,
) -> Result<Outcome, StudyError> {
    let split = request.divided();
    let unscored_s = request.score_on(&split.test)?;
    let Request {
        model,
        library,
        against,
        settings,
        space,
        budget,
        learner,
        ..
    } = request;
    let free = model.free_parameters();
    if free > FITTED_PARAMETERS {
        let model = model.name.clone();
        return Err(StudyError::TooManyParameters { model, free });
    }
    let mut split = split.in_order();
    let deadline = budget.and_then(|budget| Instant::now().checked_add(budget));
    let mut clock = Clock::start();
    let progress: &mut Observer<'_> = &mut |now: Progress<'_>| {
        clock.note(now.stage);
        progress(now);
    };
    progress(Stage::Audit.into());
    let audits = |logs: &[Log]| audit_together(logs, &model.columns);
    let for_fits = |logs: &[Log]| -> Vec<Log> {
        logs.iter()
            .map(|log| log.for_fits(settings.fit.window_s))
            .collect()
    };
    let (mut of_train, mut of_test) = (audits(&split.train), audits(&split.test));
    split.train = shortened(split.train, &mut of_train);
    split.test = shortened(split.test, &mut of_test);
    let (studied, tested) = (for_fits(&split.train), for_fits(&split.test));
    if space == Some(Space::Torque) && model.torque_balance().is_none() {
        return Err(StudyError::without_torques(model));
    }
    let study_in = |space| Study::audited(model, space, &studied, of_train.clone(), &settings);
    let mut study = study_in(space.unwrap_or(Space::Motion));
    if space.is_none() && study.is_prescribed(library.effects()) {
        study = study_in(Space::Torque);
    }
    study.deadline = deadline;
    // Where nothing moves, anything could be found.
    let nothing = Library::empty();
    let library = if study.moves() { library } else { &nothing };
    let found = find(&mut study, &tested, library, rng, progress)?;
    let alternatives = discriminate(&study, &found, progress);
    progress(Stage::Refine.into());
    let refined = refine(&study, &found.before, &found.chosen.after);
    study.identifiability = refined.identifiability.clone();
    let remainder = remainder(&study, &found, &refined);
    let with_friction = study.with_usual_friction(library.effects());
    study.tell_reversed(library.effects(), with_friction.as_ref(), &mut of_train);
    tell_gravity(&found.gravity, &mut of_train);
    tell_too_many(&study, library, &mut of_train);
    // Logs over which the model diverges tell of no push.
    if let Ok(residual) = &remainder.after {
        tell_pushes(&study, &residual.samples, &mut of_train);
    }
    let test_study = study.on(&tested);
    tell_gravity(&shares_of_gravity(&test_study), &mut of_test);
    if let Ok(forces) = residual_force(&test_study, &found.chosen.after) {
        tell_pushes(&test_study, &forces, &mut of_test);
    }
    let mut audits = [of_train, of_test].concat();
    let fitted_tests = tell_fitted_tests(&split, &mut audits);
    let learned = learn(&refined, learner, rng, progress);
    progress(Stage::Score.into());
    let by_log = study.by_log(&found.chosen.after);
    let scorer = Scorer {
        test: &split.test,
        settings: &settings.score,
    };
    let without = refined.after.model.absorbed().dynamics();
    let hybrid = (learned.as_ref()).map(|learned| learned.hybrid().unwrap_or(&without));
    let models = Scored {
        space: study.space,
        declared: model,
        before: &refined.before,
        with_friction: with_friction
            .as_ref()
            .filter(|model| !study.added(&model.model).is_empty()),
        after: &refined.after,
        hybrid,
        against: &against,
    };
    let errors = scorer.errors(models, rng);
    let (verdict, reason) = verdict(&study, &found, &refined, &errors);
    let mut findings = findings(&study, &found.chosen, &refined, &scorer);
    findings.sort_by_key(|finding| finding.effect.joint.index());
    let (findings, supported) =
        (findings.into_iter()).partition(|finding| finding.status == Status::Established);
    Ok(Outcome {
        space: study.space,
        verdict,
        reason,
        models: models_of(&study, refined),
        effects: Effects {
            findings,
            supported,
            alternatives,
            rounds: found.chosen.rounds,
            stopped: found.chosen.stopped,
        },
        remainder,
        errors,
        learned,
        by_log,
        calibration: None,
        seconds: clock.stop(),
        given: Given {
            train: split.train,
            test: split.test,
            fitted_tests,
            split: split.method,
            audits,
            settings: settings.clone(),
            unscored_s,
            prismatic: model.prismatic.clone(),
            declared: model.parameters.iter().map(|p| p.value).collect(),
            studied,
        },
    })
}

/// Say in the audits which logs repeat each other; the test logs that are training logs once more.
fn tell_fitted_tests(split: &Split, audits: &mut [Audit]) -> Vec<String> {
    let trained = split.train.len();
    let repeated = tell_repeats(split.train.iter().chain(&split.test), audits);
    let of_test = split.test.iter().zip(&repeated[trained..]);
    let is_fitted = |repeated: &Repeated| repeated.is_identical() && repeated.place < trained;
    of_test
        .filter(|(_, repeated)| repeated.as_ref().is_some_and(is_fitted))
        .map(|(log, _)| log.name())
        .collect()
}

/// What fits read of logs; of long ones their audits say so.
fn shortened(logs: Vec<Log>, audits: &mut [Audit]) -> Vec<Log> {
    let shorten = |(log, audit): (Log, &mut Audit)| {
        let is_long = log.is_long();
        let log = log.shortened();
        if let Some(note) = log.notes.last().filter(|_| is_long) {
            audit.add(Finding::new(Severity::Warning, note.clone()));
        }
        log
    };
    logs.into_iter().zip(audits).map(shorten).collect()
}

/// Say in the audit of the first log which effects are not looked for because there are too many logs.
fn tell_too_many(study: &Study<'_>, library: &Library, audits: &mut [Audit]) {
    let Some(audit) = audits.first_mut() else {
        return;
    };
    let effects = library.effects().iter();
    for effect in effects.filter(|effect| is_of_too_many(study, effect)) {
        let text = format!(
            "{} has a value for each log and is not looked for in {} logs, but in at most {}: give fewer if the logs may differ by it",
            effect.name,
            study.logs.len(),
            study.settings.select.most_by_log
        );
        audit.add(Finding::new(Severity::Warning, text));
    }
}

/// What the effects leave unexplained.
fn remainder(study: &Study<'_>, found: &Found, refined: &Refined<'_>) -> Remainder {
    let (before, after) = rayon::join(
        || ResidualForce::of(study, &found.before),
        || ResidualForce::of(study, &found.chosen.after),
    );
    Remainder {
        proposal: proposal(study, &refined.after, &found.unexplained),
        unexplained: found.unexplained.clone(),
        before,
        after,
    }
}

fn models_of(study: &Study<'_>, refined: Refined<'_>) -> Models {
    let fitted = refined.after.model.absorbed().all_parameters();
    Models {
        contradicted: contradicted(&study.declared.all_parameters(), &fitted),
        before: refined.before,
        after: refined.after,
        bodies: refined.bodies,
        uncertainty: refined.uncertainty,
        moved_to: study.moved_to.clone(),
        identifiability: study.identifiability.clone(),
    }
}
