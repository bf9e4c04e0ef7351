//! Stage 4, second half: which of the selected effects are established.

use rayon::prelude::*;

use super::fitted::Fitted;
use super::plainer::Unused;
use super::problem::Problem;
use super::select::{
    Folds, Losses, Rival, Round, Selected, Trial, candidates, gain, p_of_gains, p_value_by, rivals,
    starts,
};
use super::settings::EstablishSettings;
use super::stage::{Stage, Watch};
use crate::identify::{FitError, uncertainty};
use crate::model::{FittedEffect, Status};

/// How sure an effect of the model is.
#[derive(Debug, Clone)]
pub struct Standing {
    pub effect: FittedEffect,
    pub status: Status,
    /// Relative fall of the loss on left-out blocks due to this effect, given the others.
    pub gain: f64,
    /// Relative fall of the loss of the motion under the commands, for an effect that the motion asked for.
    pub gain_by_motion: Option<f64>,
    /// Probability of such evidence without the effect.
    pub p_value: f64,
    /// Why it is not established, in a sentence.
    pub reason: Option<String>,
    /// The model refitted without it.
    pub without: Result<Fitted, FitError>,
}

impl Standing {
    /// An effect that nothing speaks against, with its gain and p-value, and the model refitted without it.
    pub(super) fn sure(
        effect: FittedEffect,
        (gain, p_value): (f64, f64),
        without: Result<Fitted, FitError>,
    ) -> Self {
        Self {
            effect,
            status: Status::Established,
            gain,
            gain_by_motion: None,
            p_value,
            reason: None,
            without,
        }
    }
}

/// The set of effects that was chosen.
pub struct Chosen {
    /// The model with them, fitted.
    pub after: Fitted,
    /// One for each added effect, in the order of the model.
    pub standings: Vec<Standing>,
    /// The model with what it needs of the effects that most machines have, see [`Selected`].
    pub(super) usual: Option<Fitted>,
    pub rounds: Vec<Round>,
    /// Whether the search was stopped because its time ran out.
    pub stopped: bool,
    /// Effects that explain the logs as well as one that was chosen.
    pub rivals: Vec<Rival>,
    /// What plainer models, which have taken the place of the one that the search found in turn, do not use.
    pub unused: Vec<Unused>,
    /// Effects that were established beside others that left no significant residual, which a plainer model does not use.
    pub(super) unmasked: Vec<FittedEffect>,
    /// Why there are no effects, if the chosen model could not be fitted.
    pub failure: Option<FitError>,
}

impl Chosen {
    /// A model, with nothing said of effects.
    pub(super) fn of(after: Fitted) -> Self {
        Self {
            after,
            standings: Vec::new(),
            usual: None,
            rounds: Vec::new(),
            stopped: false,
            rivals: Vec::new(),
            unused: Vec::new(),
            unmasked: Vec::new(),
            failure: None,
        }
    }

    /// Number of established effects.
    pub fn established(&self) -> usize {
        self.named().count()
    }

    /// The established effects.
    pub(super) fn named(&self) -> impl Iterator<Item = &FittedEffect> {
        let established = |s: &&Standing| s.status == Status::Established;
        self.standings.iter().filter(established).map(|s| &s.effect)
    }
}

/// Judge each effect of the selected set, and look for others that explain the logs as well. `before` is the declared
/// model, which is kept without effects if no set could be fitted.
pub fn establish(
    problem: &Problem<'_>,
    before: &Fitted,
    selected: Selected,
    watch: &dyn Watch,
) -> Chosen {
    let none = Chosen {
        usual: selected.usual,
        rounds: selected.rounds,
        stopped: selected.stopped,
        ..Chosen::of(before.clone())
    };
    let chosen = match selected.chosen {
        Ok(chosen) => chosen,
        Err(failure) => {
            let failure = Some(failure);
            return Chosen { failure, ..none };
        }
    };
    watch.see(Stage::Establish.into());
    let without = without_each(problem, &chosen);
    let all = candidates(problem, &problem.declared.effects);
    let trials = all.iter().map(|candidate| starts(candidate).len()).sum();
    let standings = standings(problem, &chosen, &without, trials);
    let established: Vec<bool> = (standings.iter())
        .map(|standing| standing.status == Status::Established)
        .collect();
    let rivals = match watch.has_to_end() {
        true => Vec::new(),
        false => rivals(problem, &chosen, &without, &established),
    };
    Chosen {
        rivals,
        standings,
        after: chosen.fitted,
        ..none
    }
}

/// Judge each effect that a model has beyond the declared ones against the model refitted without it, `without`; if
/// that refit failed, the model needs the effect. `trials` is the number of candidates at all their starting points.
pub(super) fn standings(
    problem: &Problem<'_>,
    chosen: &Trial,
    without: &[Result<Trial, FitError>],
    trials: usize,
) -> Vec<Standing> {
    let halves = Folds::of(problem).in_halves();
    let crossed = |trial: &Trial| Losses::by(problem, &halves, &trial.fitted);
    let with = crossed(chosen);
    let known = uncertainty(&problem.shooting, &chosen.fitted.fit);
    let added = problem.added(&chosen.fitted.model);
    let standing = |(k, less): (usize, &Result<Trial, FitError>)| {
        let effect = chosen.fitted.model.effects[k].clone();
        let less = match less {
            Ok(less) => less,
            Err(failure) => return Standing::sure(effect, (1.0, 0.0), Err(failure.clone())),
        };
        let of_joint = |losses: &Losses| losses.of_effect(&effect);
        let (crossed_less, with) = (of_joint(&crossed(less)), of_joint(&with));
        let evidence = Evidence {
            gain: chosen.gain_over(less, &effect),
            p_of_values: p_value_by(&known, problem, &chosen.fitted, k),
            p_of_falls: p_of_gains(&crossed_less, &with),
            crossed_gain: gain(&crossed_less, &with),
            gain_by_declared: match problem.is_usual(&effect.effect) {
                true => chosen.gain_by_declared(less, &effect),
                false => 0.0,
            },
        };
        let reason = evidence.lack(trials, &problem.settings.establish);
        Standing {
            effect,
            status: match reason {
                None => Status::Established,
                Some(_) => Status::Supported,
            },
            gain: evidence.gain,
            gain_by_motion: None,
            p_value: evidence.p(&problem.settings.establish),
            reason,
            without: Ok(less.fitted.clone()),
        }
    };
    added.into_par_iter().zip(without).map(standing).collect()
}

/// The models refitted without each of the added effects.
pub(super) fn without_each(problem: &Problem<'_>, chosen: &Trial) -> Vec<Result<Trial, FitError>> {
    let less = |k: usize| {
        let fitted = problem.without_effect(&chosen.fitted, k)?;
        Ok(Trial::of(problem, fitted))
    };
    let added = problem.added(&chosen.fitted.model);
    added.into_par_iter().map(less).collect()
}

/// The evidence for one effect, given the others.
struct Evidence {
    gain: f64,
    /// By the cluster-robust Wald test; `None` for an effect that no value switches off.
    p_of_values: Option<f64>,
    /// By the falls of the loss, each half of the blocks judged with values fitted to the other half.
    p_of_falls: f64,
    crossed_gain: f64,
    /// The part of the gain that the declared values tell, of an effect that they may tell.
    gain_by_declared: f64,
}

impl Evidence {
    /// The p-value of the values, or of the falls if there is none.
    fn p_alone(&self) -> f64 {
        self.p_of_values.unwrap_or(self.p_of_falls)
    }

    /// The p-value of the values or, if it is not significant, the smaller of the two.
    fn p(&self, settings: &EstablishSettings) -> f64 {
        let alone = self.p_alone();
        match alone < settings.uncorrected_false_alarm {
            true => alone,
            false => alone.min(self.p_of_falls),
        }
    }

    /// What is missing for the effect to be established.
    fn lack(&self, trials: usize, settings: &EstablishSettings) -> Option<String> {
        let level = settings.false_alarm / trials.max(1) as f64;
        let p = self.p(settings);
        let significant = self.p_alone() < level
            || self.gain > settings.plain_gain && p < settings.uncorrected_false_alarm;
        if self.gain < settings.worthwhile_gain {
            return Some(too_small(self.gain));
        }
        if !significant {
            return Some(format!(
                "p = {p:.2e} is not significant among {trials} candidates"
            ));
        }
        // Bodies that have to leave their declaration without the effect confirm it as well as unseen blocks do.
        let confirmed = self.p_of_falls <= settings.confirming_false_alarm
            || self.crossed_gain >= settings.plain_gain
            || self.gain_by_declared >= settings.worthwhile_gain;
        (!confirmed).then(|| {
            format!(
                "fitted to one half of the blocks, it changes the loss on the other half by {:.0} % (p = {:.2})",
                -100.0 * self.crossed_gain, self.p_of_falls
            )
        })
    }
}

/// Says that an effect changes the loss on left-out blocks by too little; a negative gain is a rise.
fn too_small(gain: f64) -> String {
    let percent = 100.0 * gain.abs();
    match gain < 0.0 {
        true => format!("it raises the loss on left-out blocks by {percent:.1} %"),
        false => format!("it lowers the loss on left-out blocks by only {percent:.1} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::too_small;

    #[test]
    fn a_loss_that_rises_is_said_to_rise() {
        let raises = "it raises the loss on left-out blocks by 2.3 %";
        assert_eq!(too_small(-0.0234), raises);
        let lowers = "it lowers the loss on left-out blocks by only 0.4 %";
        assert_eq!(too_small(0.0041), lowers);
        assert_eq!(too_small(0.0), lowers.replace("0.4", "0.0"));
    }
}
