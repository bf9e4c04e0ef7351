use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::ahead::Ahead;
use super::blocks::blocks;
use super::candidate::{beside, best_start, candidates, has_switch};
use super::exchange::{Exchange, exchanges};
use super::outlook::Outlook;
use super::sets::{descent, promising};
use super::simpler::{mended, simpler};
use super::trial::{Trial, key};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::stage::{Fits, Observer, Progress, Stage};
use crate::closeloop::study::Study;
use crate::identify::FitError;
use crate::model::{Effect, FittedEffect};

/// One round of the search: the sets of effects that were fitted, best first.
#[derive(Debug, Clone)]
pub struct Round {
    /// Number of candidates beside the effects of the model that the round began with.
    pub candidates: usize,
    pub tried: Vec<Tried>,
}

/// A set of effects that was fitted.
#[derive(Debug, Clone)]
pub struct Tried {
    pub effects: Vec<FittedEffect>,
    /// Fall of the loss on left-out stretches from that of the model which the round began with, as a share.
    pub gain: f64,
    /// Whether the next round begins with it.
    pub chosen: bool,
}

/// A search for the set of effects that a model lacks, with the rounds so far.
pub struct Search<'a, 'p> {
    pub study: &'a Study<'a>,
    pub library: &'a [Effect],
    pub rounds: Vec<Round>,
    /// Exchanges that made the set worse since a round changed it, by the labels of the old and the new effect.
    vain: HashSet<[String; 2]>,
    /// What is being done, as it was told last.
    doing: String,
    progress: Mutex<&'p mut Observer<'p>>,
}

/// A set that is better than what its round began with, and its rank among the sets of the round.
struct Better {
    round: usize,
    rank: usize,
    trial: Trial,
}

impl<'a, 'p> Search<'a, 'p> {
    /// `progress` receives what is being tried.
    pub fn new(
        study: &'a Study<'a>,
        library: &'a [Effect],
        progress: &'p mut Observer<'p>,
    ) -> Self {
        Self {
            study,
            library,
            rounds: Vec::new(),
            vain: HashSet::new(),
            doing: Stage::Select.text().into(),
            progress: Mutex::new(progress),
        }
    }

    /// The simplest of the sets of effects that lower the loss on left-out stretches most.
    ///
    /// # Errors
    /// A selected model that cannot be fitted again.
    pub fn select(&mut self, declared: Fitted) -> Result<Trial, FitError> {
        let study = self.study;
        let declared = Trial::of(study, declared);
        let first = self.first(declared.clone());
        let best = self.rounds_from(first)?;
        let simplest = self.simplest(&best)?;
        let is_declared = study.added(&simplest.fitted.model).is_empty();
        Ok(if is_declared { declared } else { simplest })
    }

    /// As [`Search::select`], where the search begins over short windows, with a fit of the declared model there.
    ///
    /// # Errors
    /// A model found there that cannot be fitted over longer windows, or a selected one that cannot be fitted again.
    pub fn select_from(&mut self, short: &Study<'_>, declared: Fitted) -> Result<Trial, FitError> {
        let study = self.study;
        let progress = self
            .progress
            .get_mut()
            .unwrap_or_else(PoisonError::into_inner);
        let mut search = Search::new(short, self.library, progress);
        let first = search.first(Trial::of(short, declared));
        let best = search.rounds_from(first)?;
        self.rounds = search.rounds;
        let locals = study.shooting.initial_locals(0);
        let fitted = study.refit(&best.fitted.model, locals, None)?;
        let best = self.rounds_from(Trial::of(study, fitted))?;
        self.simplest(&best)
    }

    /// Add effects and exchange them, round by round, as long as each is better than the last.
    fn rounds_from(&mut self, mut best: Trial) -> Result<Trial, FitError> {
        let study = self.study;
        let mut passed = vec![best.key()];
        for _ in 0..study.settings.select.rounds {
            if !study.has_time() {
                break;
            }
            let Some(next) = self.next(&best) else {
                break;
            };
            best = self.estimated(next)?;
            if passed.contains(&best.key()) {
                break;
            }
            passed.push(best.key());
        }
        Ok(best)
    }

    /// The best set with effects added or, where that is not a large gain, with one exchanged: what is missing beside a
    /// wrong effect may be little more than that effect's error.
    fn next(&mut self, best: &Trial) -> Option<Trial> {
        let settings = &self.study.settings.select;
        let added = self.better(best, settings.step, Self::round);
        let is_large = |better: &Better| better.trial.loss() < best.loss() * (1.0 - settings.large);
        if added.as_ref().is_some_and(is_large) {
            self.vain.clear();
            return added.map(|added| self.choose(added));
        }
        // An exchange adds nothing, so it goes first, and a smaller gain will do.
        if let Some(exchanged) = self.better(best, settings.exchange, Self::exchanged) {
            return Some(self.choose(exchanged));
        }
        self.vain.clear();
        added.map(|added| self.choose(added))
    }

    /// A trial at a scale of its own: the residuals have fallen, and smaller effects show. It stays at the one it has where no
    /// loss is known at the new one. An effect whose values have moved to a bound gives way to what it contains: no set with
    /// it would be valid from then on.
    fn estimated(&self, trial: Trial) -> Result<Trial, FitError> {
        let anew = Trial::of(self.study, self.study.estimate(&trial.fitted)?);
        let anew = if anew.loss().is_finite() { anew } else { trial };
        match mended_from(self.study, self.library, &anew, f64::INFINITY) {
            Some(simpler) => self.estimated(simpler),
            None => Ok(anew),
        }
    }

    /// The best of a round that is better than what the round began with by this share of the loss, and not worse in its
    /// open-loop error.
    fn better(
        &mut self,
        from: &Trial,
        share: f64,
        round: impl FnOnce(&mut Self, &Trial) -> Vec<Trial>,
    ) -> Option<Better> {
        let enough = from.loss() * (1.0 - self.study.of_whole(share));
        let trials = round(self, from);
        let better = (trials.into_iter().enumerate()).take_while(|(_, t)| t.loss() < enough);
        let mut better = better.peekable();
        better.peek()?;
        let ahead = Ahead::of(self.study, from);
        let (rank, trial) = better.find(|(_, trial)| {
            let settings = &self.study.settings.select;
            !Ahead::of(self.study, trial).is_worse_than(&ahead, settings)
        })?;
        let round = self.rounds.len() - 1;
        Some(Better { round, rank, trial })
    }

    /// The trial that a round found, noted as chosen.
    fn choose(&mut self, Better { round, rank, trial }: Better) -> Trial {
        self.rounds[round].tried[rank].chosen = true;
        trial
    }

    /// Report progress.
    pub fn tell(&self, progress: Progress<'_>) {
        let mut observer = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        observer(progress);
    }

    fn say(&mut self, text: &str) {
        text.clone_into(&mut self.doing);
        self.tell(Progress::within(Stage::Select, text));
    }

    /// Report that so many of the sets of effects are fitted.
    fn tell_fitted(&self, done: usize, of: usize) {
        let fits = Some(Fits { done, of });
        let doing = Progress::within(Stage::Select, &self.doing);
        self.tell(Progress { fits, ..doing });
    }

    /// The declared model or, where it helps, the model with what most machines have.
    fn first(&mut self, declared: Trial) -> Trial {
        let study = self.study;
        let step = study.settings.select.step;
        let best = self.better(&declared, step, |search, declared| {
            search.say("fitting what most machines have");
            let blocks = blocks(study, search.library);
            let fitted = search.fitted_for_the_best(declared, blocks);
            search.noted(declared, fitted, 0)
        });
        let best = best.map(|best| self.choose(best));
        match best.map(|best| self.estimated(best)) {
            Some(Ok(best)) => best,
            _ => declared,
        }
    }

    /// Fit the sets that promise most beside a model, the best first.
    fn round(&mut self, from: &Trial) -> Vec<Trial> {
        let study = self.study;
        let all = candidates(study, self.library, &from.fitted.model.effects);
        self.say(&format!("screening {} effects", all.len()));
        let mut sets = Vec::new();
        let declared = study.declared.effects.len();
        if let Some(outlook) = Outlook::of(study, &from.fitted, &all) {
            let promising = promising(&outlook, study);
            sets = promising.iter().map(|set| outlook.effects(set)).collect();
        }
        // What no value switches off cannot be compared without a fit.
        sets.extend(
            all.iter()
                .filter(|c| !has_switch(c))
                .filter_map(|candidate| {
                    let beside = beside(study, &from.fitted, candidate)?;
                    let start = best_start(study, &beside, candidate)?;
                    let mut set = beside.model.effects[declared..].to_vec();
                    set.push(start);
                    Some(set)
                }),
        );
        self.say(&format!("fitting {} sets of effects", sets.len()));
        let fitted = self.fitted_for_the_best(from, sets);
        self.noted(from, fitted, all.len())
    }

    /// The declared model with each set of effects in place of those of a trial, the most promising first, fitted at its
    /// scale, to find the best one: those that cannot be better than the trial or the first few are left out.
    fn fitted_for_the_best(&self, from: &Trial, mut sets: Vec<Vec<FittedEffect>>) -> Vec<Trial> {
        let first = self.study.settings.select.first.min(sets.len());
        let rest = sets.split_off(first);
        let mut trials = self.fitted(from, sets, from.loss());
        let below = trials.iter().map(Trial::loss).fold(from.loss(), f64::min);
        trials.extend(self.fitted(from, rest, below));
        trials
    }

    /// The declared model with each set of effects in place of those of a trial, fitted at its scale; those that cannot
    /// be fitted, or leave more than a loss of `below`, are left out. No loss on stretches left out is smaller than that
    /// of the fit itself. An effect whose values stand at a bound gives way to what it contains.
    fn fitted(&self, from: &Trial, mut sets: Vec<Vec<FittedEffect>>, below: f64) -> Vec<Trial> {
        let (study, library) = (self.study, self.library);
        sets.iter_mut().for_each(without_contained);
        let most = (study.settings.select).most_effects_of(study.declared.joints);
        sets.retain(|set| set.len() <= most);
        first_of_each(&mut sets, vec![from.added_key(study)], |set| key(set));
        let trial = |set: Vec<FittedEffect>| {
            let found = fitted_from(study, from, &set, below)?;
            if found.is_valid(study) {
                return Some(found);
            }
            mended_from(study, library, &found, below)
        };
        let (of, done) = (sets.len(), AtomicUsize::new(0));
        self.tell_fitted(0, of);
        let tell =
            |_: &Option<Trial>| self.tell_fitted(done.fetch_add(1, Ordering::Relaxed) + 1, of);
        let tried = sets.into_par_iter().map(trial).inspect(tell);
        let mut trials: Vec<Trial> = tried.flatten().collect();
        first_of_each(&mut trials, Vec::new(), Trial::key);
        trials
    }

    /// Fit the sets in which one effect is exchanged for another like it, the best first. What was in vain once is not
    /// tried again.
    fn exchanged(&mut self, from: &Trial) -> Vec<Trial> {
        self.say("exchanging effects");
        let study = self.study;
        let mut exchanges = exchanges(study, self.library, &from.fitted);
        exchanges.retain(|exchange| !self.vain.contains(&exchange.labels));
        if exchanges.is_empty() {
            return Vec::new();
        }
        let sets = exchanges.iter().map(|exchange| exchange.set.clone());
        let fitted = self.fitted(from, sets.collect(), from.loss());
        let better = fitted.iter().filter(|trial| trial.loss() < from.loss());
        let better: Vec<Vec<String>> = better.map(|trial| trial.added_key(study)).collect();
        let is_vain = |exchange: &Exchange| !better.contains(&key(&exchange.set));
        let vain = exchanges.iter().filter(|exchange| is_vain(exchange));
        self.vain
            .extend(vain.map(|exchange| exchange.labels.clone()));
        self.noted(from, fitted, exchanges.len())
    }

    /// Note a round, and return its trials, the best first.
    fn noted(&mut self, from: &Trial, mut trials: Vec<Trial>, candidates: usize) -> Vec<Trial> {
        trials.sort_by(|a, b| a.loss().total_cmp(&b.loss()));
        let gain = |trial: &Trial| 1.0 - trial.loss() / from.loss().max(f64::MIN_POSITIVE);
        let tried = |trial: &Trial| Tried {
            effects: trial.added(self.study).to_vec(),
            gain: gain(trial),
            chosen: false,
        };
        let tried = trials.iter().map(tried).collect();
        self.rounds.push(Round { candidates, tried });
        trials
    }

    /// Drop effects, or put simpler ones in their place, as long as the set explains the logs as well as the best one.
    fn simplest(&mut self, best: &Trial) -> Result<Trial, FitError> {
        self.say("simplifying");
        let study = self.study;
        let declared = study.declared.effects.len();
        let mut current = self.least(best, best);
        loop {
            let added = study.added(&current.fitted.model);
            let sets = simpler(self.library, &current.fitted.model.effects, added.clone());
            let mut sets: Vec<_> = sets
                .into_iter()
                .map(|set| set[declared..].to_vec())
                .collect();
            let exchanges = exchanges(study, self.library, &current.fitted);
            sets.extend(exchanges.into_iter().map(|exchange| exchange.set));
            sets.extend(added.clone().map(|k| {
                let mut less = current.fitted.model.effects[declared..].to_vec();
                less.remove(k - declared);
                less
            }));
            let good = self.as_good_as(best, &current, sets);
            let is_simpler = |trial: &Trial| trial.values() < current.values();
            let (mut good, mut other): (Vec<_>, Vec<_>) = good.into_iter().partition(is_simpler);
            if good.is_empty() {
                // An exchange may make others needless.
                other.sort_by(|a, b| a.loss().total_cmp(&b.loss()));
                let few = other.iter().take(study.settings.select.exchanged);
                good = few.map(|trial| self.least(trial, best)).collect();
                good.retain(is_simpler);
            }
            let order = |a: &Trial, b: &Trial| {
                let by_loss = a.loss().total_cmp(&b.loss());
                a.shifts().cmp(&b.shifts()).then(by_loss)
            };
            match good.into_iter().min_by(order) {
                Some(simpler) => current = self.least(&simpler, best),
                None => return self.estimated(current),
            }
        }
    }

    /// The smallest set of a trial's effects that explains the logs as well as the best one, among those that predicted
    /// losses lead to.
    fn least(&self, trial: &Trial, best: &Trial) -> Trial {
        let study = self.study;
        let Some(outlook) = Outlook::of(study, &trial.fitted, &[]) else {
            return trial.clone();
        };
        let settings = &study.settings.select;
        let within = |set: &Vec<usize>| {
            let losses = outlook.losses(set);
            let sum = losses.map_or(f64::INFINITY, |losses| losses.iter().sum());
            sum <= best.loss() * (1.0 + settings.slack * settings.simpler)
        };
        let all = outlook.present();
        let mut unshifted = all.clone();
        unshifted.retain(|&item| outlook.items[item].shifted().is_none());
        let mut sets: Vec<_> = [descent(&outlook, all), vec![unshifted.clone()]].concat();
        sets.extend(descent(&outlook, unshifted));
        sets.retain(within);
        let sets = sets.iter().map(|set| outlook.effects(set)).collect();
        let good = self.as_good_as(best, trial, sets);
        let size = |trial: &Trial| (trial.fitted.model.effects.len(), trial.shifts());
        good.into_iter()
            .min_by_key(size)
            .unwrap_or_else(|| trial.clone())
    }

    /// The sets that explain the logs as well as the best one, fitted from a trial.
    fn as_good_as(&self, best: &Trial, from: &Trial, sets: Vec<Vec<FittedEffect>>) -> Vec<Trial> {
        let settings = &self.study.settings.select;
        let mut trials = self.fitted(from, sets, best.loss() * (1.0 + settings.simpler));
        trials.retain(|trial| trial.is_as_good_as(best, settings));
        trials
    }
}

/// The declared model with a set of effects in place of those of a trial, fitted at its scale to a loss of `below`, if time is
/// left.
fn fitted_from(study: &Study<'_>, from: &Trial, set: &[FittedEffect], below: f64) -> Option<Trial> {
    if !study.has_time() {
        return None;
    }
    let effects = [study.declared.effects.as_slice(), set].concat();
    let fitted = study.with_better_effects(&from.fitted, effects, below)?;
    Some(Trial::of(study, fitted))
}

/// A trial with what each effect contains in place of those whose values are not consistent, fitted from there to a loss of
/// `below`; `None` where all are, or where that leaves no valid set.
fn mended_from(study: &Study<'_>, library: &[Effect], trial: &Trial, below: f64) -> Option<Trial> {
    if trial.is_consistent(study) {
        return None;
    }
    let set = mended(library, &study.declared.effects, trial.added(study));
    fitted_from(study, trial, &set, below).filter(|found| found.is_valid(study))
}

/// Drop those whose key has been met: among `met`, or among those before them.
fn first_of_each<T>(
    items: &mut Vec<T>,
    mut met: Vec<Vec<String>>,
    key: impl Fn(&T) -> Vec<String>,
) {
    items.retain(|item| {
        let key = key(item);
        let is_new = !met.contains(&key);
        met.push(key);
        is_new
    });
}

/// Drop effects that another one of the set contains.
fn without_contained(set: &mut Vec<FittedEffect>) {
    let all = set.clone();
    set.retain(|part| !all.iter().any(|whole| whole.contains(part)));
}
