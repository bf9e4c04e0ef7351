use rand::Rng;

use super::confirm::{Withdrawn, confirm};
use super::error::StudyError;
use super::fitted::Fitted;
use super::remainder::{Unexplained, unexplained};
use super::select::{Rival, Round, Search, left_out_losses};
use super::split::set_aside;
use super::stage::{Progress, Stage};
use super::study::Study;
use crate::identify::FitError;
use crate::model::{FittedEffect, Library};

/// The result of searching the logs for what the declared model lacks.
pub struct Found {
    /// The declared model, fitted.
    pub before: Fitted,
    pub chosen: Chosen,
    pub unexplained: Unexplained,
}

/// What was selected on a part of the logs and confirmed on the rest.
pub struct Chosen {
    /// The model with the confirmed effects, fitted to all logs.
    pub after: Fitted,
    pub rounds: Vec<Round>,
    /// Effects that explain the logs as well as one that was selected.
    pub rivals: Vec<Rival>,
    pub withdrawn: Vec<Withdrawn>,
    /// Stretches of data set aside that the effects were confirmed on; 0 where the logs leave none.
    pub confirmed_on: usize,
    /// Why the selected effects were withdrawn, if the model with them could not be fitted.
    pub failure: Option<FitError>,
}

/// Stages 3 to 5: fit the declared model, select effects on a part of the logs, confirm them on the rest, fit the model
/// with the confirmed ones to all logs and test its residuals.
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
            .withdrawn
            .extend(all_withdrawn(study, &chosen.after, MASKING));
        chosen.after = before.clone();
        left = test(&chosen.after, rng);
    }
    Ok(Found {
        before,
        chosen,
        unexplained: left,
    })
}

/// Why effects are withdrawn that leave most of the loss and an unexplained remainder.
const MASKING: &str = "an unexplained remainder stays, and all effects together cut the loss by less than half: it would \
                       mask the real cause";

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
        .and_then(|confirmed| Ok((on_all(study, before, &confirmed.fitted)?, confirmed)));
    Ok(match confirmed {
        Ok((after, confirmed)) => Chosen {
            after,
            rivals: search.rivals(&confirmed.fitted),
            rounds: search.rounds,
            withdrawn: confirmed.withdrawn,
            confirmed_on: confirmed.stretches,
            failure: None,
        },
        Err(error) => Chosen {
            after: before.clone(),
            rivals: Vec::new(),
            rounds: search.rounds,
            withdrawn: all_withdrawn(
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
    if study.added(&chosen.model).is_empty() {
        return Ok(before.clone());
    }
    study.refit(&chosen.model, before.fit.locals.clone(), None)
}

/// All added effects of a model, withdrawn for one reason.
fn all_withdrawn(study: &Study<'_>, fitted: &Fitted, reason: &str) -> Vec<Withdrawn> {
    let added = &fitted.model.effects[study.added(&fitted.model)];
    let withdrawn = |effect: &FittedEffect| Withdrawn {
        effect: effect.clone(),
        reason: reason.to_owned(),
    };
    added.iter().map(withdrawn).collect()
}

/// Loss that the effects leave, as a share of the declared model's, on stretches left out of the fits.
fn share_left(study: &Study<'_>, before: &Fitted, after: &Fitted) -> f64 {
    // Losses are in units of each fit's own scale.
    let loss = |model: &Fitted| {
        left_out_losses(study, &model.fit).iter().sum::<f64>() * model.fit.scale.powi(2)
    };
    loss(after) / loss(before).max(f64::MIN_POSITIVE)
}
