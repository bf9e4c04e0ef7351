use std::collections::HashMap;

use rayon::prelude::*;

use super::candidate::{beside, best_start, candidates, starts};
use super::evidence::Evidence;
use super::folds::left_out_losses;
use super::simpler::simpler;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::settings::SelectSettings;
use crate::closeloop::stage::{Progress, Stage};
use crate::closeloop::study::Study;
use crate::identify::FitError;
use crate::model::{Effect, EffectParameter, FittedEffect};

/// One round of the search: the candidates tried beside the effects of a model, best first.
#[derive(Debug, Clone)]
pub struct Round {
    /// Number of candidates that were screened.
    pub candidates: usize,
    /// Those with the largest predicted decrease, fitted, best first.
    pub evidence: Vec<Evidence>,
    /// Index of the one that is admitted.
    pub chosen: Option<usize>,
}

/// A set of effects that explains the logs as well as the chosen one: it has `effect` in place of `instead_of`.
#[derive(Debug, Clone)]
pub struct Rival {
    pub fitted: Fitted,
    pub effect: FittedEffect,
    pub instead_of: FittedEffect,
    /// Fall of the left-out loss by either, beside the other effects.
    pub gain: f64,
    pub gain_of_chosen: f64,
}

impl Rival {
    /// Whether the chosen effect is a special case of the rival.
    pub fn contains_chosen(&self) -> bool {
        let (own, chosen) = (&self.effect, &self.instead_of);
        own.joint == chosen.joint && own.effect.contains.contains(&chosen.effect.name)
    }
}

/// The effects of a model, in no particular order.
type Key = Vec<String>;

fn key(effects: &[FittedEffect]) -> Key {
    let mut key: Key = effects.iter().map(FittedEffect::label).collect();
    key.sort();
    key
}

/// A search for the effects that a model lacks, with the rounds so far.
pub struct Search<'a, 'p> {
    study: &'a Study<'a>,
    library: &'a [Effect],
    /// Rounds so far, by the effects of the model.
    known_rounds: HashMap<Key, Round>,
    /// Models that the search has visited.
    passed: Vec<Key>,
    /// The rounds that were to add one more effect, in their order.
    pub rounds: Vec<Round>,
    progress: &'p mut dyn FnMut(Progress<'_>),
}

impl<'a, 'p> Search<'a, 'p> {
    /// `progress` receives what is being tried.
    pub fn new(
        study: &'a Study<'a>,
        library: &'a [Effect],
        progress: &'p mut dyn FnMut(Progress<'_>),
    ) -> Self {
        Self {
            study,
            library,
            known_rounds: HashMap::new(),
            passed: Vec::new(),
            rounds: Vec::new(),
            progress,
        }
    }

    /// Add effects of the library while the loss on stretches that are left out of the fit falls significantly,
    /// then exchange, simplify and remove until each effect is the best choice beside all others.
    ///
    /// # Errors
    /// A selected model that cannot be fitted again.
    pub fn select(&mut self, declared: Fitted) -> Result<Fitted, FitError> {
        let mut fitted = declared;
        let most = self.study.settings.select.most_effects;
        while self.study.added(&fitted.model).len() < most {
            let round = self.round(&fitted, None);
            self.rounds.push(round.clone());
            let next = match round.chosen {
                Some(chosen) => Some(round.evidence[chosen].fitted.clone()),
                None => self.exchanged(&fitted),
            };
            let Some(next) = next else { break };
            // The scale of the residuals has fallen: it is estimated anew, so that smaller effects show.
            let next = self.simplified(self.study.estimate(&next)?);
            if self.has_passed(&next) {
                break;
            }
            fitted = next;
        }
        Ok(fitted)
    }

    /// Report progress.
    pub fn tell(&mut self, progress: Progress<'_>) {
        (self.progress)(progress);
    }

    fn say(&mut self, text: &str) {
        self.tell(Progress::within(Stage::Select, text));
    }

    fn has_passed(&mut self, fitted: &Fitted) -> bool {
        let key = key(&fitted.model.effects);
        let known = self.passed.contains(&key);
        self.passed.push(key);
        known
    }

    /// Fit and rank the candidates that could join `model`; `wanted` is among them whatever its predicted decrease.
    fn round(&mut self, fitted: &Fitted, wanted: Option<&FittedEffect>) -> Round {
        let at = key(&fitted.model.effects);
        let is_wanted = |c: &FittedEffect| wanted.is_some_and(|wanted| wanted.label() == c.label());
        if let Some(known) = self.known_rounds.get(&at)
            && (wanted.is_none() || known.evidence.iter().any(|e| is_wanted(&e.effect)))
        {
            return known.clone();
        }
        let all = candidates(self.study, self.library, &fitted.model.effects);
        let mut screened = self.screened(fitted, &all);
        let most = self.study.settings.select.fitted;
        let rest = screened.split_off(most.min(screened.len()));
        screened.extend(rest.into_iter().filter(is_wanted));
        let losses = left_out_losses(self.study, &fitted.fit);
        self.say(&format!("fitting {} effects", screened.len()));
        let study = self.study;
        let mut evidence: Vec<Evidence> = screened
            .into_par_iter()
            .filter_map(|start| weigh(study, fitted, start, &losses))
            .collect();
        evidence.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let trials = all.iter().map(|candidate| starts(candidate).len()).sum();
        let round = Round {
            candidates: all.len(),
            chosen: choose(&evidence, trials, &study.settings.select),
            evidence,
        };
        self.known_rounds.insert(at, round.clone());
        round
    }

    /// Candidates at their best starting points, by predicted cost.
    fn screened(&mut self, fitted: &Fitted, all: &[FittedEffect]) -> Vec<FittedEffect> {
        self.say(&format!("screening {} effects", all.len()));
        let study = self.study;
        let mut screened: Vec<(FittedEffect, f64)> = all
            .par_iter()
            .filter_map(|candidate| {
                let beside = beside(study, fitted, candidate)?;
                best_start(study, &beside, candidate)
            })
            .collect();
        // A Gauss-Newton step predicts badly for an effect that no value switches off: such candidates are always
        // fitted.
        screened.sort_by(|a, b| {
            has_switch(&a.0)
                .cmp(&has_switch(&b.0))
                .then(a.1.total_cmp(&b.1))
        });
        screened.into_iter().map(|(start, _)| start).collect()
    }

    /// Drop effects that another one has made needless, or put simpler ones in their place that do as well.
    fn simplified(&self, fitted: Fitted) -> Fitted {
        let study = self.study;
        let loss = |fitted: &Fitted| left_out_losses(study, &fitted.fit).iter().sum::<f64>();
        let most = loss(&fitted) * (1.0 + study.settings.select.simpler);
        let simpler = simpler(
            self.library,
            &fitted.model.effects,
            study.added(&fitted.model),
        );
        let first = simpler.into_par_iter().find_map_first(|effects| {
            let less = study.with_effects(&fitted, effects).ok()?;
            (loss(&less) < most).then_some(less)
        });
        match first {
            Some(less) => self.simplified(less),
            None => fitted,
        }
    }

    /// Test each effect of the model again in the presence of all others, since early ones were selected without those
    /// that followed. Returns the first other model that the evidence supports.
    fn exchanged(&mut self, fitted: &Fitted) -> Option<Fitted> {
        self.study.added(&fitted.model).find_map(|k| {
            let (present, without) = self.without(fitted, k)?;
            let round = self.round(&without, Some(&present));
            match round.chosen.map(|chosen| &round.evidence[chosen]) {
                None => Some(without),
                Some(best) if best.effect.label() == present.label() => None,
                Some(best) => Some(best.fitted.clone()),
            }
        })
    }

    /// Effects that explain the logs as well as one of a model's effects does, beside its others.
    pub fn rivals(&mut self, fitted: &Fitted) -> Vec<Rival> {
        let settings = &self.study.settings.select;
        let mut rivals = Vec::new();
        for k in self.study.added(&fitted.model) {
            let Some((present, without)) = self.without(fitted, k) else {
                continue;
            };
            let round = self.round(&without, Some(&present));
            let is_present = |e: &&Evidence| e.effect.label() == present.label();
            let Some(chosen) = round.evidence.iter().find(is_present) else {
                continue;
            };
            let others = round.evidence.iter().filter(|e| !is_present(e));
            rivals.extend(
                others
                    .filter(|e| e.is_as_good_as(chosen, settings))
                    .map(|e| Rival {
                        fitted: e.fitted.clone(),
                        effect: e.effect.clone(),
                        instead_of: present.clone(),
                        gain: e.gain,
                        gain_of_chosen: chosen.gain,
                    }),
            );
        }
        rivals
    }

    /// The k-th effect, and the model refitted without it.
    fn without(&self, fitted: &Fitted, k: usize) -> Option<(FittedEffect, Fitted)> {
        let present = fitted.model.effects[k].clone();
        Some((present, self.study.without_effect(fitted, k).ok()?))
    }
}

/// Fit a candidate and judge it.
fn weigh(
    study: &Study<'_>,
    model: &Fitted,
    start: FittedEffect,
    without: &[f64],
) -> Option<Evidence> {
    let mut effects = beside(study, model, &start)?.model.effects;
    effects.push(start);
    let fitted = study.with_effects(model, effects).ok()?;
    Evidence::of(study, fitted, without)
}

/// Whether some value of a parameter switches the effect off, so that it can start from absent.
fn has_switch(candidate: &FittedEffect) -> bool {
    candidate
        .effect
        .parameters
        .iter()
        .any(EffectParameter::is_switch)
}

/// Index of the candidate to admit: of all candidates that are significant over so many trials, worthwhile
/// and as good as the best, the one with the fewest parameters.
fn choose(evidence: &[Evidence], trials: usize, settings: &SelectSettings) -> Option<usize> {
    #[allow(clippy::cast_precision_loss)] // few trials
    let level = settings.false_alarm / trials.max(1) as f64;
    let sound = |e: &Evidence| {
        e.p_value < level && e.gain > settings.worthwhile
            || e.p_value < settings.significant_alone && e.gain > settings.plain
    };
    let best = evidence.iter().find(|e| sound(e))?;
    (0..evidence.len())
        .filter(|&i| sound(&evidence[i]) && evidence[i].is_as_good_as(best, settings))
        .min_by_key(|&i| evidence[i].complexity())
}
