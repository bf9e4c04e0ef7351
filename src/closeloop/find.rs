use rand::Rng;

use super::confirm::{TakenBack, confirm};
use super::error::StudyError;
use super::fitted::Fitted;
use super::remainder::{Unexplained, unexplained};
use super::select::{Rival, Round, Search, folds, left_out_losses};
use super::split::set_aside;
use super::stage::{Progress, Stage};
use super::study::Study;
use crate::identify::FitError;
use crate::model::{FittedEffect, Library};

/// What the logs say about what the declared model lacks.
pub struct Found {
    /// The declared model, fitted.
    pub before: Fitted,
    /// With the effects that stood, fitted.
    pub after: Fitted,
    pub rounds: Vec<Round>,
    /// Effects that explain the logs as well as one that was selected.
    pub rivals: Vec<Rival>,
    pub taken_back: Vec<TakenBack>,
    /// Stretches of data set aside that the effects were confirmed on; 0 where the logs leave none.
    pub confirmed_on: usize,
    pub unexplained: Unexplained,
    /// Why the selected effects were taken back, if the model with them could not be fitted.
    pub failure: Option<FitError>,
}

/// Stages 3 to 5: fit the declared model, choose effects on a part of the logs, confirm them on the rest, fit what
/// stood to all of them and test what is left.
///
/// # Errors
/// As [`Study::fit_declared`].
pub fn find(
    study: &mut Study<'_>,
    library: &Library,
    rng: &mut impl Rng,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Found, StudyError> {
    progress(Stage::Fit.into());
    let before = study.fit_declared()?;
    let mut chosen = choose(study, library, &before, progress)?;
    progress(Stage::Remainder.into());
    let test =
        |after: &Fitted, rng: &mut _| unexplained(study, library.probes(), &before, after, rng);
    let mut left = test(&chosen.after, rng);
    let share = share_left(study, &before, &chosen.after);
    if left.is_significant() && share > study.settings.confirm.masking {
        chosen
            .taken_back
            .extend(all_taken_back(study, &chosen.after, MASKING));
        chosen.after = before.clone();
        left = test(&chosen.after, rng);
    }
    Ok(Found {
        before,
        after: chosen.after,
        rounds: chosen.rounds,
        rivals: chosen.rivals,
        taken_back: chosen.taken_back,
        confirmed_on: chosen.confirmed_on,
        unexplained: left,
        failure: chosen.failure,
    })
}

/// Why effects are taken back that leave most of the loss beside an unexplained remainder.
const MASKING: &str = "an unexplained remainder stays, and all effects together cut the loss by less than half: it would \
                       mask the real cause";

/// What was selected on a part of the logs and confirmed on the rest.
struct Chosen {
    /// Fitted to all logs.
    after: Fitted,
    rounds: Vec<Round>,
    rivals: Vec<Rival>,
    taken_back: Vec<TakenBack>,
    confirmed_on: usize,
    failure: Option<FitError>,
}

fn choose(
    study: &Study<'_>,
    library: &Library,
    before: &Fitted,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Chosen, StudyError> {
    let (kept, aside) = set_aside(study.logs, study.settings);
    let (mut kept, aside) = (study.on(&kept), study.on(&aside));
    let declared = kept.fit_declared()?;
    let mut search = Search::new(&kept, library.effects(), progress);
    let selected = search.select(declared)?;
    search.tell(Stage::Confirm.into());
    let confirmed = confirm(&kept, &aside, selected.clone())
        .and_then(|confirmed| Ok((on_all(study, before, &confirmed.model)?, confirmed)));
    Ok(match confirmed {
        Ok((after, confirmed)) => Chosen {
            after,
            rivals: search.rivals(&confirmed.model),
            rounds: search.rounds,
            taken_back: confirmed.taken_back,
            confirmed_on: confirmed.stretches,
            failure: None,
        },
        Err(error) => Chosen {
            after: before.clone(),
            rivals: Vec::new(),
            rounds: search.rounds,
            taken_back: all_taken_back(
                study,
                &selected,
                &format!("the model with it cannot be fitted to all training logs: {error}"),
            ),
            confirmed_on: 0,
            failure: Some(error),
        },
    })
}

/// The chosen effects fitted to all logs.
fn on_all(study: &Study<'_>, before: &Fitted, chosen: &Fitted) -> Result<Fitted, FitError> {
    if chosen.effects.len() == study.system.effects.len() {
        return Ok(before.clone());
    }
    let locals = before.fit.locals.clone();
    study.refit(chosen, locals, None)
}

/// All added effects of a model, taken back for one reason.
fn all_taken_back(study: &Study<'_>, model: &Fitted, reason: &str) -> Vec<TakenBack> {
    let added = &model.effects[study.system.effects.len()..];
    let taken_back = |effect: &FittedEffect| TakenBack {
        effect: effect.clone(),
        reason: reason.to_owned(),
    };
    added.iter().map(taken_back).collect()
}

/// Loss that the effects leave, as a share of the declared model's, on stretches left out of the fits.
fn share_left(study: &Study<'_>, before: &Fitted, after: &Fitted) -> f64 {
    let folds = folds(study);
    // Losses are in units of each fit's own scale.
    let loss = |model: &Fitted| {
        left_out_losses(&model.fit, &folds).iter().sum::<f64>() * model.fit.scale.powi(2)
    };
    loss(after) / loss(before).max(f64::MIN_POSITIVE)
}
