use rand::Rng;

use super::confirm::{Confirmed, TakenBack, confirm};
use super::folds::{folds, left_out_losses};
use super::outcome::Alternative;
use super::run::Stage;
use super::search::{Round, Search};
use super::split::set_aside;
use super::study::{Fitted, Study, StudyError};
use super::unexplained::{Unexplained, unexplained};
use crate::model::Library;

/// What the logs say about what the declared model lacks.
pub struct Found {
    /// The declared model, fitted.
    pub before: Fitted,
    /// With the effects that stood, fitted.
    pub after: Fitted,
    pub rounds: Vec<Round>,
    pub alternatives: Vec<Alternative>,
    pub taken_back: Vec<TakenBack>,
    /// Stretches of data set aside that the effects were confirmed on; 0 where the logs leave none.
    pub confirmed_on: usize,
    pub unexplained: Unexplained,
}

/// Where something is left that no effect explains, effects that leave more than this share of the loss do not
/// explain it either: they stand in for what is missing.
const HALF: f64 = 0.5;

/// Fit the declared model, choose effects on a part of the logs, confirm them on the rest, fit what stood to
/// all of them and ask what is left.
///
/// # Errors
/// As [`Study::fit_declared`].
pub fn find(
    study: &mut Study<'_>,
    library: &Library,
    rng: &mut impl Rng,
    progress: &mut dyn FnMut(Stage<'_>),
) -> Result<Found, StudyError> {
    let mut stage = |number: usize, text: &str| progress(Stage { number, text });
    stage(0, "fitting the declared model");
    let before = study.fit_declared()?;
    let (chosen_by, aside) = set_aside(study.logs);
    let mut chosen_by = study.on(&chosen_by);
    let aside = study.on(&aside);
    let declared = chosen_by.fit_declared()?;
    let mut tell = |text: &str| stage(1, text);
    let mut search = Search::new(&chosen_by, library.effects(), &mut tell);
    let model = search.select(declared);
    let Confirmed {
        model,
        mut taken_back,
        stretches,
    } = confirm(&chosen_by, &aside, model);
    let rivals = search.rivals(&model);
    let rounds = search.rounds;
    let mut after = on_all(study, &before, &model);
    stage(2, "asking what is left");
    let mut left = unexplained(study, library.probes(), &before, &after, rng);
    if left.is_significant() && share_left(study, &before, &after) > HALF {
        taken_back.extend(stand_ins(study, &after));
        after = before.clone();
        left = unexplained(study, library.probes(), &before, &after, rng);
    }
    let alternatives = Alternative::of_rivals(study, rivals, &after, &mut |text| stage(3, text));
    Ok(Found {
        alternatives,
        before,
        after,
        rounds,
        taken_back,
        confirmed_on: stretches,
        unexplained: left,
    })
}

/// The chosen effects fitted to all logs.
fn on_all(study: &Study<'_>, before: &Fitted, chosen: &Fitted) -> Fitted {
    if chosen.effects.len() == study.system.effects.len() {
        return before.clone();
    }
    let locals = before.fit.locals.clone();
    study
        .refit(&chosen.effects, &chosen.declared, locals, None)
        .unwrap_or_else(|_| before.clone())
}

/// Loss that the effects leave, as a share of the declared model's, on stretches left out of the fits.
fn share_left(study: &Study<'_>, before: &Fitted, after: &Fitted) -> f64 {
    let folds = folds(&study.shooting);
    // Losses are in units of each fit's own scale.
    let loss = |model: &Fitted| {
        left_out_losses(&model.fit, &folds).iter().sum::<f64>() * model.fit.scale.powi(2)
    };
    loss(after) / loss(before).max(f64::MIN_POSITIVE)
}

fn stand_ins(study: &Study<'_>, model: &Fitted) -> Vec<TakenBack> {
    let reason = "something is left that it does not explain, and all effects together cut the loss by less \
                  than half: it would stand in for what is missing";
    model.effects[study.system.effects.len()..]
        .iter()
        .map(|effect| TakenBack {
            effect: effect.clone(),
            reason: reason.into(),
        })
        .collect()
}
