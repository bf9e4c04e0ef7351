use rayon::prelude::*;

use super::fitted::Fitted;
use super::per_log::values_on;
use super::select::{PLAIN, gain, p_of_gains};
use super::study::Study;
use crate::identify::{blocks, fit};
use crate::model::FittedEffect;

/// An effect that was chosen and did not stand.
#[derive(Debug, Clone)]
pub struct TakenBack {
    pub effect: FittedEffect,
    /// Why, in a sentence.
    pub reason: String,
}

/// What came of confirming a choice.
#[derive(Debug, Clone)]
pub struct Confirmed {
    pub model: Fitted,
    pub taken_back: Vec<TakenBack>,
    /// Stretches that the choice was confirmed on; 0 where the logs left none.
    pub stretches: usize,
}

/// An effect stands that lowers the loss on data it was not chosen by, with this probability of doing so by
/// accident, or that plainly helps: they are few, and it was significant over the whole library before.
const CONFIRMED: f64 = 0.1;
/// Fewer stretches than this prove nothing either way.
const FEWEST: usize = 4;
/// A change of the loss by less than this share: the motion does not show the effect.
const NOT_SHOWN: f64 = 0.01;

/// Ask of each effect of a model, fitted in `study`, whether it lowers the loss on data set aside, and take back
/// those that do not, the least sure first.
pub fn confirm(study: &Study<'_>, aside: &Study<'_>, model: Fitted) -> Confirmed {
    let members = blocks(&aside.shooting);
    let stretches = members.last().map_or(0, |last| last + 1);
    let mut confirmed = Confirmed {
        model,
        taken_back: Vec::new(),
        stretches,
    };
    if stretches < FEWEST {
        confirmed.stretches = 0;
        return confirmed;
    }
    while let Some((doubtful, without)) = most_doubtful(study, aside, &confirmed.model, &members) {
        confirmed.taken_back.push(doubtful);
        confirmed.model = without;
    }
    confirmed
}

/// The effect that is confirmed least, if there is one that is not, and the model without it.
fn most_doubtful(
    study: &Study<'_>,
    aside: &Study<'_>,
    model: &Fitted,
    members: &[usize],
) -> Option<(TakenBack, Fitted)> {
    let with = losses(aside, model, model.fit.scale, members)?;
    let declared = study.system.effects.len();
    let unsure: Vec<(f64, TakenBack, Fitted)> = (declared..model.effects.len())
        .into_par_iter()
        .filter_map(|k| {
            let mut effects = model.effects.clone();
            let effect = effects.remove(k);
            let (locals, scale) = (model.fit.locals.clone(), Some(model.fit.scale));
            let less = study.refit(&effects, &model.declared, locals, scale).ok()?;
            let without = losses(aside, &less, model.fit.scale, members)?;
            let (p, saved) = (p_of_gains(&without, &with), gain(&without, &with));
            (p > CONFIRMED && saved < PLAIN && saved.abs() > NOT_SHOWN).then(|| {
                let reason = format!(
                    "on stretches that it was not chosen by it changes the loss by {:.0} % (p = {p:.2})",
                    -100.0 * saved
                );
                (p, TakenBack { effect, reason }, less)
            })
        })
        .collect();
    (unsure.into_iter())
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, taken_back, less)| (taken_back, less))
}

/// Loss of a model on each stretch set aside, its parameters as they are, the start states free; so is what a log
/// has of its own where the fit has not seen the log.
fn losses(aside: &Study<'_>, model: &Fitted, scale: f64, members: &[usize]) -> Option<Vec<f64>> {
    let locals = aside.shooting.initial_locals(0);
    let values = values_on(aside.logs, &model.declared, &model.effects);
    let is_known = |k: &usize| values.own.iter().any(|own| own.parameter == *k);
    let parameters = &model.dynamics.parameters;
    let unknown: Vec<usize> = (0..parameters.len())
        .filter(|k| parameters[*k].per_log && !parameters[*k].fixed && !is_known(k))
        .collect();
    let found = fit(
        &aside.shooting,
        &model.dynamics,
        &unknown,
        values,
        locals,
        Some(scale),
    )
    .ok()?;
    let mut losses = vec![0.0; members.last().map_or(0, |last| last + 1)];
    for (terms, &member) in found.reduced.iter().zip(members) {
        losses[member] += terms.terms.cost;
    }
    Some(losses)
}
