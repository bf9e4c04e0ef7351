use rayon::prelude::*;

use super::fitted::Fitted;
use super::select::{gain, p_of_gains};
use super::settings::ConfirmSettings;
use super::study::Study;
use crate::identify::{FitError, Values, blocks, fit};
use crate::model::FittedEffect;

/// A selected effect that was not confirmed.
#[derive(Debug, Clone)]
pub struct Withdrawn {
    pub effect: FittedEffect,
    /// Why, in a sentence.
    pub reason: String,
}

/// The selected model without the effects that were not confirmed.
#[derive(Debug, Clone)]
pub struct Confirmed {
    pub fitted: Fitted,
    pub withdrawn: Vec<Withdrawn>,
    /// Stretches that the choice was confirmed on; 0 where the logs left none.
    pub stretches: usize,
}

/// Test whether each effect of a model, fitted in `study`, lowers the loss on data set aside, and withdraw those that
/// do not, the least sure first.
///
/// # Errors
/// A model that diverges on the data set aside with and without each of its effects.
pub fn confirm(
    study: &Study<'_>,
    aside: &Study<'_>,
    fitted: Fitted,
) -> Result<Confirmed, FitError> {
    let members = blocks(&aside.shooting);
    let stretches = members.last().map_or(0, |last| last + 1);
    let mut confirmed = Confirmed {
        fitted,
        withdrawn: Vec::new(),
        stretches,
    };
    if stretches < study.settings.confirm.fewest_stretches {
        confirmed.stretches = 0;
        return Ok(confirmed);
    }
    while let Some(least) = least_sure(study, aside, &confirmed.fitted, &members)? {
        confirmed.withdrawn.push(least.withdrawn);
        confirmed.fitted = least.without;
    }
    Ok(confirmed)
}

/// An effect that the data set aside do not confirm.
struct Unconfirmed {
    p_value: f64,
    withdrawn: Withdrawn,
    /// The model without it.
    without: Fitted,
}

/// The effect that is confirmed least, if there is one that is not.
fn least_sure(
    study: &Study<'_>,
    aside: &Study<'_>,
    fitted: &Fitted,
    members: &[usize],
) -> Result<Option<Unconfirmed>, FitError> {
    let with = losses(aside, fitted, fitted.fit.scale, members);
    let unsure: Vec<Unconfirmed> = (study.added(&fitted.model).into_par_iter())
        .filter_map(|k| unconfirmed(study, aside, fitted, members, &with, k))
        .collect();
    let least = (unsure.into_iter()).max_by(|a, b| a.p_value.total_cmp(&b.p_value));
    match (least, with) {
        (None, Err(error)) => Err(error),
        (least, _) => Ok(least),
    }
}

/// The k-th effect of a model, if the data set aside do not confirm it. `with` is the loss of the model there.
fn unconfirmed(
    study: &Study<'_>,
    aside: &Study<'_>,
    fitted: &Fitted,
    members: &[usize],
    with: &Result<Vec<f64>, FitError>,
    k: usize,
) -> Option<Unconfirmed> {
    let effect = fitted.model.effects[k].clone();
    // A model that cannot be fitted, or diverges, without an effect needs it.
    let without = study.without_effect(fitted, k).ok()?;
    let (p_value, reason) = match with {
        Err(_) => (
            1.0,
            "with it the model diverges on stretches that it was not chosen by".to_owned(),
        ),
        Ok(with) => {
            let less = losses(aside, &without, fitted.fit.scale, members).ok()?;
            let (p, saved) = (p_of_gains(&less, with), gain(&less, with));
            let ConfirmSettings {
                significance,
                not_shown,
                ..
            } = study.settings.confirm;
            let stands = p <= significance
                || saved >= study.settings.select.plain
                || saved.abs() <= not_shown;
            if stands {
                return None;
            }
            let change = -100.0 * saved;
            let reason = format!(
                "on stretches that it was not chosen by it changes the loss by {change:.0} % (p = {p:.2})"
            );
            (p, reason)
        }
    };
    Some(Unconfirmed {
        p_value,
        withdrawn: Withdrawn { effect, reason },
        without,
    })
}

/// Loss of a model on each stretch set aside, its parameters as they are, the start states free; so is what a log
/// has of its own where the fit has not seen the log.
fn losses(
    aside: &Study<'_>,
    fitted: &Fitted,
    scale: f64,
    members: &[usize],
) -> Result<Vec<f64>, FitError> {
    let locals = aside.shooting.initial_locals(0);
    let dynamics = fitted.model.dynamics();
    let known = Values::of(&dynamics, aside.logs).own;
    let is_known = |k: &usize| known.iter().any(|own| own.parameter == *k);
    let parameters = &dynamics.parameters;
    let unknown: Vec<usize> = (0..parameters.len())
        .filter(|k| parameters[*k].per_log && !parameters[*k].fixed && !is_known(k))
        .collect();
    let (_, found) = fit(&aside.shooting, &dynamics, &unknown, locals, Some(scale))?;
    let mut losses = vec![0.0; members.last().map_or(0, |last| last + 1)];
    for (terms, &member) in found.reduced.iter().zip(members) {
        losses[member] += terms.terms.cost;
    }
    Ok(losses)
}
