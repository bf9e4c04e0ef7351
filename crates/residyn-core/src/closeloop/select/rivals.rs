use rayon::prelude::*;

use super::candidate::candidates;
use super::evidence::gain;
use super::screening::{Screening, Set};
use super::sets::lowest;
use super::trial::{Trial, differences};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::settings::SelectSettings;
use crate::data::statistics::{mean, standard_error};
use crate::identify::FitError;
use crate::model::FittedEffect;

/// A set of effects that explains the logs as well as the chosen one: it has `effect` in place of `instead_of`.
#[derive(Debug, Clone)]
pub struct Rival {
    pub fitted: Fitted,
    pub effect: FittedEffect,
    pub instead_of: FittedEffect,
    /// Fall of the left-out loss by the rival, next to the other effects; then by the chosen effect.
    pub gain: f64,
    pub gain_of_chosen: f64,
}

impl Rival {
    /// Whether the chosen effect is a special case of the rival.
    pub fn contains_chosen(&self) -> bool {
        self.effect.contains(&self.instead_of)
    }
}

/// Effects that explain the logs as well in place of one of the chosen effects; `without` holds the model refitted
/// without each chosen effect, `of` says for which of them rivals are wanted.
pub fn rivals(
    problem: &Problem<'_>,
    chosen: &Trial,
    without: &[Result<Trial, FitError>],
    of: &[bool],
) -> Vec<Rival> {
    let added = problem.added(&chosen.fitted.model);
    let all = candidates(problem, &chosen.fitted.model.effects);
    let Some(screening) = Screening::of(problem, &chosen.fitted, &all) else {
        return Vec::new();
    };
    let of_effect = |(k, less): (usize, &Result<Trial, FitError>)| {
        let less = less.as_ref().ok().filter(|_| of[k])?;
        Some(instead_of(problem, chosen, less, &screening, k))
    };
    let places = (0..added.len()).into_par_iter();
    let rivals: Vec<Vec<Rival>> = places.zip(without).filter_map(of_effect).collect();
    rivals.concat()
}

/// Effects that do as well as the k-th added effect, which `less` lacks.
fn instead_of(
    problem: &Problem<'_>,
    chosen: &Trial,
    less: &Trial,
    screening: &Screening,
    k: usize,
) -> Vec<Rival> {
    let settings = &problem.settings.select;
    let declared = problem.declared.effects.len();
    let present = &chosen.fitted.model.effects[declared + k];
    let mut others = screening.present();
    others.remove(k);
    let sets = (screening.present().len()..screening.items.len())
        .map(|item| [others.as_slice(), &[item]].concat());
    let mut options = lowest(screening, sets.collect(), settings.rivals_per_effect);
    options.retain(|(loss, _)| {
        *loss <= settings.prediction_slack * settings.rival_loss * chosen.loss()
    });
    let own = |trial: &Trial| trial.losses.of_effect(present);
    let gain = |trial: &Trial| gain(&own(less), &own(trial));
    let rival = |(_, set): (f64, Set)| {
        let mut effects = chosen.fitted.model.effects.clone();
        effects[declared + k] = screening.items[*set.last()?].clone();
        let below = settings.rival_loss * chosen.loss();
        let fitted = problem.with_better_effects(&chosen.fitted, effects, below)?;
        let trial = Trial::of(problem, fitted);
        let is_as_good = is_as_good([&trial, chosen, less], present, settings);
        let as_good = trial.is_valid(problem) && is_as_good;
        as_good.then(|| Rival {
            effect: trial.fitted.model.effects[declared + k].clone(),
            instead_of: present.clone(),
            gain: gain(&trial),
            gain_of_chosen: gain(chosen),
            fitted: trial.fitted,
        })
    };
    options.into_iter().filter_map(rival).collect()
}

/// Whether the left-out losses on an effect's joints do not distinguish a set from the chosen one; `less` has neither
/// effect.
fn is_as_good(
    [trial, chosen, less]: [&Trial; 3],
    effect: &FittedEffect,
    settings: &SelectSettings,
) -> bool {
    let [trial, chosen, less] = [trial, chosen, less].map(|of| of.losses.of_effect(effect));
    let sum = |losses: &[f64]| losses.iter().sum::<f64>();
    let differences = differences(&trial, &chosen);
    let saved = |losses: &[f64]| sum(&less) - sum(losses);
    mean(&differences) <= settings.rival_standard_errors * standard_error(&differences)
        && saved(&trial) > settings.rival_saving * saved(&chosen)
        && sum(&trial) <= settings.rival_loss * sum(&chosen)
}
