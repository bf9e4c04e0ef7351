use rand::Rng;

use super::confirm::{Confirmed, TakenBack, confirm};
use super::error::StudyError;
use super::fitted::Fitted;
use super::remainder::{Unexplained, unexplained};
use super::select::{Rival, Round, Search, folds, left_out_losses};
use super::split::set_aside;
use super::stage::{Progress, Stage};
use super::study::Study;
use crate::model::Library;

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
}

/// Where something is left that no effect explains, effects that leave more than this share of the loss do not
/// explain it either: they mask the real cause.
const HALF: f64 = 0.5;

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
    let mut chosen = choose(study, library, progress)?;
    let mut after = on_all(study, &before, &chosen.model);
    progress(Stage::Remainder.into());
    let mut left = unexplained(study, library.probes(), &before, &after, rng);
    if left.is_significant() && share_left(study, &before, &after) > HALF {
        chosen.taken_back.extend(masking(study, &after));
        after = before.clone();
        left = unexplained(study, library.probes(), &before, &after, rng);
    }
    Ok(Found {
        before,
        after,
        rounds: chosen.rounds,
        rivals: chosen.rivals,
        taken_back: chosen.taken_back,
        confirmed_on: chosen.confirmed_on,
        unexplained: left,
    })
}

/// What was selected on a part of the logs and confirmed on the rest.
struct Chosen {
    model: Fitted,
    rounds: Vec<Round>,
    rivals: Vec<Rival>,
    taken_back: Vec<TakenBack>,
    confirmed_on: usize,
}

fn choose(
    study: &Study<'_>,
    library: &Library,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Chosen, StudyError> {
    let (kept, aside) = set_aside(study.logs);
    let (mut kept, aside) = (study.on(&kept), study.on(&aside));
    let declared = kept.fit_declared()?;
    let mut search = Search::new(&kept, library.effects(), progress);
    let selected = search.select(declared);
    search.tell(Stage::Confirm.into());
    let Confirmed {
        model,
        taken_back,
        stretches,
    } = confirm(&kept, &aside, selected);
    Ok(Chosen {
        rivals: search.rivals(&model),
        rounds: search.rounds,
        model,
        taken_back,
        confirmed_on: stretches,
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

/// All added effects of a model, taken back.
fn masking(study: &Study<'_>, model: &Fitted) -> Vec<TakenBack> {
    let reason = "an unexplained remainder stays, and all effects together cut the loss by less than half: it would \
                  mask the real cause";
    model.effects[study.system.effects.len()..]
        .iter()
        .map(|effect| TakenBack {
            effect: effect.clone(),
            reason: reason.into(),
        })
        .collect()
}
