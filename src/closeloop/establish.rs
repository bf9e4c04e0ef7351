//! Stage 5: which of the selected effects are established.

use rayon::prelude::*;

use super::fitted::Fitted;
use super::select::{Folds, Losses, Trial, gain, p_of_gains, p_value};
use super::settings::EstablishSettings;
use super::study::Study;
use crate::identify::FitError;
use crate::model::{FittedEffect, Status};

/// How sure an effect of the model is.
#[derive(Debug, Clone)]
pub struct Standing {
    pub effect: FittedEffect,
    pub status: Status,
    /// Fall of the loss on left-out stretches by this effect beside the others, as a share.
    pub gain: f64,
    /// Probability of such evidence without the effect.
    pub p_value: f64,
    /// Why it is not established, in a sentence.
    pub reason: Option<String>,
    /// The model refitted without it.
    pub without: Result<Fitted, FitError>,
}

/// Judge each effect that a model has beyond the declared ones by the model refitted without it, `without`; where that
/// failed, the model needs the effect. `trials` is the number of candidates, at all their starting points.
pub(super) fn establish(
    study: &Study<'_>,
    chosen: &Trial,
    without: &[Result<Trial, FitError>],
    trials: usize,
) -> Vec<Standing> {
    let halves = Folds::of(study).in_halves();
    let crossed = |trial: &Trial| Losses::by(study, &halves, &trial.fitted);
    let with = crossed(chosen);
    let added = study.added(&chosen.fitted.model);
    let standing = |(k, less): (usize, &Result<Trial, FitError>)| {
        let effect = chosen.fitted.model.effects[k].clone();
        let less = match less {
            Ok(less) => less,
            Err(failure) => {
                return Standing {
                    effect,
                    status: Status::Established,
                    gain: 1.0,
                    p_value: 0.0,
                    reason: None,
                    without: Err(failure.clone()),
                };
            }
        };
        let of_joint = |losses: &Losses| losses.of_effect(&effect);
        let (crossed_less, with) = (of_joint(&crossed(less)), of_joint(&with));
        let evidence = Evidence {
            gain: gain(&of_joint(&less.losses), &of_joint(&chosen.losses)),
            p_of_values: p_value(study, &chosen.fitted, k),
            p_of_falls: p_of_gains(&crossed_less, &with),
            crossed_gain: gain(&crossed_less, &with),
        };
        let reason = evidence.lack(trials, &study.settings.establish);
        Standing {
            effect,
            status: if reason.is_none() {
                Status::Established
            } else {
                Status::Supported
            },
            gain: evidence.gain,
            p_value: evidence.p(&study.settings.establish),
            reason,
            without: Ok(less.fitted.clone()),
        }
    };
    added.into_par_iter().zip(without).map(standing).collect()
}

/// The models refitted without each of the added effects.
pub(super) fn without_each(study: &Study<'_>, chosen: &Trial) -> Vec<Result<Trial, FitError>> {
    let less = |k: usize| {
        let fitted = study.without_effect(&chosen.fitted, k)?;
        Ok(Trial::of(study, fitted))
    };
    study
        .added(&chosen.fitted.model)
        .into_par_iter()
        .map(less)
        .collect()
}

/// What speaks for one effect beside the others.
struct Evidence {
    gain: f64,
    /// By the cluster-robust Wald test; `None` for an effect that no value switches off.
    p_of_values: Option<f64>,
    /// By the falls of the loss, each half of the stretches judged with the values that fit the other.
    p_of_falls: f64,
    crossed_gain: f64,
}

impl Evidence {
    /// The p-value of the values, or of the falls where there is none.
    fn p_alone(&self) -> f64 {
        self.p_of_values.unwrap_or(self.p_of_falls)
    }

    /// The p-value of the values or, where they say little, the smaller one.
    fn p(&self, settings: &EstablishSettings) -> f64 {
        let alone = self.p_alone();
        match alone < settings.significant_alone {
            true => alone,
            false => alone.min(self.p_of_falls),
        }
    }

    /// What is missing for the effect to be established.
    fn lack(&self, trials: usize, settings: &EstablishSettings) -> Option<String> {
        #[allow(clippy::cast_precision_loss)] // few trials
        let level = settings.false_alarm / trials.max(1) as f64;
        let p = self.p(settings);
        let significant =
            self.p_alone() < level || self.gain > settings.plain && p < settings.significant_alone;
        if self.gain < settings.worthwhile {
            return Some(too_small(self.gain));
        }
        if !significant {
            return Some(format!(
                "p = {p:.2e} is too large among {trials} candidates"
            ));
        }
        let confirmed =
            self.p_of_falls <= settings.confirmed || self.crossed_gain >= settings.plain;
        (!confirmed).then(|| {
            format!(
                "with values fitted to one half of the stretches it changes the loss on the other by {:.0} % (p = {:.2})",
                -100.0 * self.crossed_gain, self.p_of_falls
            )
        })
    }
}

/// That an effect changes the loss on left-out stretches by too little; a negative gain is a rise.
fn too_small(gain: f64) -> String {
    let percent = 100.0 * gain.abs();
    match gain < 0.0 {
        true => format!("it raises the loss on left-out stretches by {percent:.1} %"),
        false => format!("it lowers the loss on left-out stretches by {percent:.1} % only"),
    }
}

#[cfg(test)]
mod tests {
    use super::too_small;

    #[test]
    fn a_loss_that_rises_is_said_to_rise() {
        let raises = "it raises the loss on left-out stretches by 2.3 %";
        assert_eq!(too_small(-0.0234), raises);
        let lowers = "it lowers the loss on left-out stretches by 0.4 % only";
        assert_eq!(too_small(0.0041), lowers);
        assert_eq!(too_small(0.0), lowers.replace("0.4", "0.0"));
    }
}
