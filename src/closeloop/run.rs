use rand::Rng;

use super::discriminate::discriminate;
use super::error::StudyError;
use super::find::{Found, find};
use super::learn::learn;
use super::outcome::{Effects, Given, Models, Outcome, Remainder};
use super::refine::{Refined, refine};
use super::remainder::{ResidualForce, proposal};
use super::request::Request;
use super::score::{Scorer, contradicted, findings};
use super::stage::{Progress, Stage};
use super::study::Study;
use super::verdict::verdict;
use crate::data::audit;

/// Fit the declared model, add effects while they lower the loss on stretches left out of the fit, train the residual
/// network on the remainder, and score the models before and after on the test logs.
///
/// # Errors
/// Logs without a usable window, or a declared model that diverges from its starting values.
pub fn close_loop(
    request: Request<'_>,
    rng: &mut impl Rng,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Outcome, StudyError> {
    request.check()?;
    let Request {
        model,
        library,
        split,
        against,
        settings,
        learner,
    } = request;
    progress(Stage::Audit.into());
    let mut study = Study::new(model, &split.train, &settings);
    let test_audits = split.test.iter().map(audit);
    let audits = study.audits().iter().cloned().chain(test_audits).collect();
    let found = find(&mut study, library, rng, progress)?;
    let alternatives = discriminate(&study, &found, progress);
    progress(Stage::Refine.into());
    let refined = refine(&study, &found.before, &found.chosen.after);
    let remainder = remainder(&study, &found, &refined);
    let learned = learn(&refined, learner, rng, progress)?;
    progress(Stage::Score.into());
    let scorer = Scorer {
        test: &split.test,
        settings: &settings.score,
    };
    let hybrid = learned.as_ref().map(|learned| learned.hybrid());
    let models = [&refined.before, &refined.after];
    let errors = scorer.errors(model, models, hybrid, &against, rng);
    let findings = findings(
        &study,
        &found.chosen.after,
        &refined,
        &scorer,
        &errors.after,
    );
    let (verdict, reason) = verdict(&study, &found, &refined, &errors);
    Ok(Outcome {
        verdict,
        reason,
        models: models_of(&study, refined),
        effects: Effects {
            findings,
            alternatives,
            withdrawn: found.chosen.withdrawn,
            confirmed_on: found.chosen.confirmed_on,
            rounds: found.chosen.rounds,
        },
        remainder,
        errors,
        learned,
        calibration: None,
        given: Given {
            train: split.train.clone(),
            test: split.test,
            split: split.method,
            audits,
            settings: settings.clone(),
            prismatic: model.prismatic.clone(),
        },
    })
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
        identifiability: study.identifiability.clone(),
    }
}
