use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::baseline::baseline_sets;
use super::candidate::{candidates, has_switch};
use super::exchange::{Exchange, Hopeless, Pair, exchanges};
use super::helpful::Helpful;
use super::identity::EffectId;
use super::open_loop_check::OpenLoopCheck;
use super::scale::at_other_scales;
use super::screen::screen;
use super::screening::Screening;
use super::sets::descent;
use super::simpler::{repaired, simpler};
use super::trial::Trial;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fit::Declared;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::stage::{Fits, Progress, Stage, Watch};
use crate::identify::FitError;
use crate::model::FittedEffect;

/// One round of the search: the sets of effects that were fitted, best first.
#[derive(Debug, Clone)]
pub struct Round {
    /// Number of candidates that the model at the start of the round lacks.
    pub candidates: usize,
    pub tried: Vec<Tried>,
}

/// A set of effects that was fitted.
#[derive(Debug, Clone)]
pub struct Tried {
    pub effects: Vec<FittedEffect>,
    /// Fall of the loss on left-out blocks, as a share of the loss of the model that the round began with.
    pub gain: f64,
    /// Whether the next round begins with it.
    pub chosen: bool,
}

/// A search for the set of effects that a model lacks, with the rounds so far.
struct Search<'a> {
    problem: &'a Problem<'a>,
    watch: &'a dyn Watch,
    usual: Option<Fitted>,
    rounds: Vec<Round>,
    /// Exchanges that made the set worse since a round changed it.
    rejected: HashSet<Pair>,
    hopeless: Hopeless,
    transmissions: Helpful,
    others: Helpful,
    /// The current activity, as last reported.
    doing: String,
}

/// A set that is better than the one that its round began with, and its rank in the round.
struct Better {
    round: usize,
    rank: usize,
    trial: Trial,
}

/// The set of effects that a search ended with.
pub struct Selected {
    /// The model with the set, or why it could not be fitted.
    pub(in crate::closeloop) chosen: Result<Trial, FitError>,
    /// The model with what it needs of the effects that most machines have, if torques are compared: they are fitted in
    /// no time.
    pub(in crate::closeloop) usual: Option<Fitted>,
    pub rounds: Vec<Round>,
    /// Whether the search was stopped early.
    pub stopped: bool,
}

/// The simplest of the sets of effects that, added to the fitted declared model, lower the loss on left-out blocks
/// most.
pub fn select(problem: &Problem<'_>, declared: &Fitted, watch: &dyn Watch) -> Selected {
    let mut search = Search::new(problem, watch);
    let chosen = search.select(declared.clone());
    search.end(chosen)
}

/// As [`select`], with a search that begins with a model that has effects, fitted to the same errors.
pub fn select_beginning_with(problem: &Problem<'_>, first: Fitted, watch: &dyn Watch) -> Selected {
    let mut search = Search::new(problem, watch);
    let best = search.rounds_from(Trial::of(problem, first));
    let chosen = best.and_then(|best| search.simplest(&best));
    search.end(chosen)
}

/// As [`select`], with a search that begins over short windows, from a fit of the declared model there.
pub fn select_from(problem: &Problem<'_>, short: &Declared<'_>, watch: &dyn Watch) -> Selected {
    let mut search = Search::new(problem, watch);
    let chosen = search.select_from(short);
    search.end(chosen)
}

impl<'a> Search<'a> {
    fn new(problem: &'a Problem<'a>, watch: &'a dyn Watch) -> Self {
        Self {
            problem,
            watch,
            usual: None,
            rounds: Vec::new(),
            rejected: HashSet::new(),
            hopeless: Hopeless::default(),
            transmissions: Helpful::default(),
            others: Helpful::default(),
            doing: Stage::Select.text().into(),
        }
    }

    fn end(self, chosen: Result<Trial, FitError>) -> Selected {
        Selected {
            chosen,
            usual: self.usual,
            rounds: self.rounds,
            stopped: self.watch.has_to_end(),
        }
    }

    /// # Errors
    /// If the selected model cannot be fitted again.
    fn select(&mut self, declared: Fitted) -> Result<Trial, FitError> {
        let problem = self.problem;
        let declared = Trial::of(problem, declared);
        let first = self.first(declared.clone());
        if problem.error_model == ErrorModel::InverseDynamics {
            self.usual = self.simplest(&first).ok().map(|usual| usual.fitted);
        }
        let best = self.rounds_from(first)?;
        let simplest = self.simplest(&best)?;
        let is_declared = problem.added(&simplest.fitted.model).is_empty();
        Ok(if is_declared { declared } else { simplest })
    }

    /// # Errors
    /// If the model found over short windows cannot be fitted over longer ones, or the selected model cannot be fitted
    /// again.
    fn select_from(&mut self, short: &Declared<'_>) -> Result<Trial, FitError> {
        let problem = self.problem;
        let mut search = Search::new(&short.problem, self.watch);
        let first = search.first(Trial::of(&short.problem, short.fitted.clone()));
        let best = search.rounds_from(first)?;
        self.rounds = search.rounds;
        let start_states = problem.shooting.initial_start_states(0);
        let fitted = problem.refit(&best.fitted.model, start_states, None)?;
        let best = self.rounds_from(Trial::of(problem, fitted))?;
        self.simplest(&best)
    }

    /// Add and exchange effects, round by round, as long as each round is better than the last.
    fn rounds_from(&mut self, mut best: Trial) -> Result<Trial, FitError> {
        let problem = self.problem;
        let mut passed = vec![best.key()];
        for _ in 0..problem.settings.select.most_rounds {
            if self.watch.has_to_end() {
                break;
            }
            let Some(next) = self.next(&best, &passed)? else {
                break;
            };
            best = next;
            if passed.contains(&best.key()) {
                break;
            }
            passed.push(best.key());
        }
        Ok(best)
    }

    /// The best set with effects added or, if the gain is not large, with one exchanged: an effect added to a wrong one
    /// may do little more than correct that effect's error. An exchange that turns out to lead back to a `passed` set,
    /// estimated anew, does not stand in the way of an effect to add.
    ///
    /// # Errors
    /// If the set cannot be fitted again.
    fn next(&mut self, best: &Trial, passed: &[Vec<EffectId>]) -> Result<Option<Trial>, FitError> {
        let settings = &self.problem.settings.select;
        let added = self.better(best, settings.round_gain, Self::round);
        let is_large = |better: &Better| self.is_large_gain(&better.trial, best);
        // An exchange adds nothing, so it goes first, and a smaller gain will do.
        if !added.as_ref().is_some_and(is_large)
            && let Some(exchanged) = self.better(best, settings.exchange_gain, Self::exchanged)
        {
            let next = self.estimated(exchanged.trial.clone())?;
            if added.is_none() || !passed.contains(&next.key()) {
                self.choose(exchanged);
                return Ok(Some(next));
            }
        }
        self.rejected.clear();
        let added = added.map(|added| self.choose(added));
        added.map(|added| self.estimated(added)).transpose()
    }

    /// A trial with its scale estimated anew: the residuals have fallen, and smaller effects show. It keeps its present
    /// scale if the loss at the new one is unknown. An effect whose values have moved to a bound is replaced by the
    /// effects that it contains: no set with it would be valid from then on.
    fn estimated(&self, trial: Trial) -> Result<Trial, FitError> {
        let (problem, Fitted { model, fit }) = (self.problem, trial.fitted);
        let at = |scale| problem.refit(&model, fit.start_states.clone(), scale);
        let mut anew = Trial::of(problem, at(None)?);
        if !anew.loss().is_finite() {
            anew = Trial::of(problem, at(Some(fit.scale))?);
        }
        match self.repaired_from(&anew, f64::INFINITY) {
            Some(simpler) => self.estimated(simpler),
            None => Ok(anew),
        }
    }

    /// The best set of a round that lowers the loss of the round's start by this share and does not worsen the
    /// open-loop error.
    fn better(
        &mut self,
        from: &Trial,
        share: f64,
        round: impl FnOnce(&mut Self, &Trial) -> Vec<Trial>,
    ) -> Option<Better> {
        let enough = from.loss() * (1.0 - self.problem.of_whole(share));
        let trials = round(self, from);
        let better = (trials.into_iter().enumerate()).take_while(|(_, t)| t.loss() < enough);
        let mut better = better.peekable();
        better.peek()?;
        let ahead = OpenLoopCheck::of(self.problem, from);
        let (rank, trial) = better.find(|(_, trial)| {
            let settings = &self.problem.settings.select;
            !OpenLoopCheck::of(self.problem, trial).is_worse_than(&ahead, settings)
        })?;
        let round = self.rounds.len() - 1;
        Some(Better { round, rank, trial })
    }

    /// The trial that a round found, noted as chosen.
    fn choose(&mut self, Better { round, rank, trial }: Better) -> Trial {
        self.rounds[round].tried[rank].chosen = true;
        trial
    }

    fn say(&mut self, text: &str) {
        text.clone_into(&mut self.doing);
        self.watch.see(Progress::within(Stage::Select, text));
    }

    /// Report how many of the sets of effects are fitted.
    fn report_fitted(&self, done: usize, of: usize) {
        let fits = Some(Fits { done, of });
        let doing = Progress::within(Stage::Select, &self.doing);
        self.watch.see(Progress { fits, ..doing });
    }

    /// The declared model or, if it helps, the model with the baseline effects.
    fn first(&mut self, declared: Trial) -> Trial {
        let problem = self.problem;
        let step = problem.settings.select.round_gain;
        let best = self.better(&declared, step, |search, declared| {
            search.say("fitting baseline friction");
            let start = declared.moved_to_first_optimum(problem);
            let baseline = baseline_sets(problem).into_iter();
            let baseline = baseline.map(|set| problem.at_first_optimum(set)).collect();
            let fitted = search.fitted_for_the_best(&start, baseline);
            search.noted(declared, fitted, 0)
        });
        let best = best.map(|best| self.choose(best));
        match best.map(|best| self.estimated(best)) {
            Some(Ok(best)) => best,
            _ => declared,
        }
    }

    /// Fit the sets with the largest predicted gain over a model, and return them best first. Transmissions, each of which
    /// takes as long as all other effects together, are fitted only if none of those brings a large gain.
    fn round(&mut self, from: &Trial) -> Vec<Trial> {
        let problem = self.problem;
        let candidates = candidates(problem, &from.fitted.model.effects);
        let number = candidates.len();
        let (transmissions, others): (Vec<_>, Vec<_>) =
            (candidates.into_iter()).partition(|new| new.effect.is_transmission());
        self.say(&format!("screening {} effects", others.len()));
        let (switched, unswitched): (Vec<_>, Vec<_>) = others.into_iter().partition(has_switch);
        let mut sets = screen(problem, &from.fitted, &switched);
        sets.extend(self.others.with_one_more(problem, from, unswitched));
        self.say(&format!("fitting {} sets of effects", sets.len()));
        let mut fitted = self.fitted_for_the_best(from, sets);
        let is_large = |trial: &Trial| self.is_large_gain(trial, from);
        if !transmissions.is_empty() && !fitted.iter().any(is_large) {
            self.say("fitting transmissions");
            let sets = self
                .transmissions
                .with_one_more(problem, from, transmissions);
            fitted.extend(self.fitted_for_the_best(from, sets));
        }
        self.noted(from, fitted, number)
    }

    fn is_large_gain(&self, trial: &Trial, from: &Trial) -> bool {
        trial.loss() < from.loss() * (1.0 - self.problem.settings.select.large_gain)
    }

    /// The declared model with each set of effects in place of a trial's, the most promising first, fitted at the
    /// trial's scale to find the best one: sets that cannot be better than the trial or the first few are left out.
    fn fitted_for_the_best(&self, from: &Trial, mut sets: Vec<Vec<FittedEffect>>) -> Vec<Trial> {
        let settings = &self.problem.settings.select;
        let rest = sets.split_off(settings.fitted_to_the_end.min(sets.len()));
        let mut trials = self.fitted(from, sets, from.loss());
        let below = trials.iter().map(Trial::loss).fold(from.loss(), f64::min);
        trials.extend(self.fitted(from, rest, below));
        trials
    }

    /// The declared model with each set of effects in place of a trial's, fitted at the trial's scale; sets that cannot
    /// be fitted, or leave a loss above `below`, are left out. The loss on left-out blocks is never smaller than that
    /// of the fit itself. An effect with values at a bound is replaced by the effects that it contains; of one with a value
    /// that the logs do not determine, that is held if the effect's file allows it.
    fn fitted(&self, from: &Trial, mut sets: Vec<Vec<FittedEffect>>, below: f64) -> Vec<Trial> {
        let problem = self.problem;
        sets.iter_mut().for_each(without_contained);
        let effects = sets.iter_mut().flatten();
        effects.for_each(|effect| effect.effect.free_held());
        let most = (problem.settings.select).most_effects_of(problem.declared.joints);
        sets.retain(|set| set.len() <= most);
        let key = |set: &Vec<FittedEffect>| problem.key(set);
        first_of_each(&mut sets, vec![from.added_key(problem)], key);
        let trial = |set: Vec<FittedEffect>| {
            let found = self.fitted_from(from, &set, below)?;
            let valid = match found.is_valid(problem) {
                true => found,
                false => (self.repaired_from(&found, below))
                    .or_else(|| self.with_unknown_held(&found, below))?,
            };
            // There may be hundreds.
            Some(valid.without_windows())
        };
        let (of, done) = (sets.len(), AtomicUsize::new(0));
        self.report_fitted(0, of);
        let tell =
            |_: &Option<Trial>| self.report_fitted(done.fetch_add(1, Ordering::Relaxed) + 1, of);
        let tried = sets.into_par_iter().map(trial).inspect(tell);
        let mut trials: Vec<Trial> = tried.flatten().collect();
        first_of_each(&mut trials, Vec::new(), Trial::key);
        trials
    }

    /// Fit the sets in which one effect is exchanged for a similar one, and return them best first. A rejected exchange
    /// is not tried again.
    fn exchanged(&mut self, from: &Trial) -> Vec<Trial> {
        self.say("exchanging effects");
        let problem = self.problem;
        self.hopeless.forget_after_far_fall(problem, from);
        let limit = self.promising_below(from);
        let mut exchanges = exchanges(problem, &from.fitted, limit, &mut self.hopeless);
        exchanges.retain(|exchange| !self.rejected.contains(&exchange.pair));
        if exchanges.is_empty() {
            return Vec::new();
        }
        let sets = exchanges.iter().map(|exchange| exchange.set.clone());
        let fitted = self.fitted(from, sets.collect(), from.loss());
        let better = fitted.iter().filter(|trial| trial.loss() < from.loss());
        let better: Vec<Vec<EffectId>> = better.map(|trial| trial.added_key(problem)).collect();
        let is_rejected = |exchange: &Exchange| !better.contains(&problem.key(&exchange.set));
        let rejected = exchanges.iter().filter(|exchange| is_rejected(exchange));
        self.rejected
            .extend(rejected.map(|exchange| exchange.pair.clone()));
        self.noted(from, fitted, exchanges.len())
    }

    /// Record a round, and return its trials, the best first.
    fn noted(&mut self, from: &Trial, mut trials: Vec<Trial>, candidates: usize) -> Vec<Trial> {
        trials.sort_by(|a, b| a.loss().total_cmp(&b.loss()));
        let tried = |trial: &Trial| Tried {
            effects: trial.added(self.problem).to_vec(),
            gain: 1.0 - trial.loss() / from.loss().max(f64::MIN_POSITIVE),
            chosen: false,
        };
        let tried = trials.iter().map(tried).collect();
        self.rounds.push(Round { candidates, tried });
        trials
    }

    /// Drop effects, or replace them by simpler ones, as long as the set explains the logs as well as the best one.
    fn simplest(&mut self, best: &Trial) -> Result<Trial, FitError> {
        self.say("simplifying");
        let problem = self.problem;
        let declared = problem.declared.effects.len();
        let mut current = self.least(best, best);
        loop {
            let added = problem.added(&current.fitted.model);
            let effects = &current.fitted.model.effects;
            let simpler = simpler(problem, effects, added.clone()).into_iter();
            let mut sets: Vec<_> = simpler.map(|set| set[declared..].to_vec()).collect();
            let limit = self.promising_below(best);
            let exchanges = exchanges(problem, &current.fitted, limit, &mut self.hopeless);
            sets.extend(exchanges.into_iter().map(|exchange| exchange.set));
            sets.extend(at_other_scales(problem.declared, &effects[declared..]));
            sets.extend(self.without_one(&current, best));
            let good = self.as_good_as(best, &current, sets);
            let is_simpler = |trial: &Trial| trial.values() < current.values();
            let (mut good, mut other): (Vec<_>, Vec<_>) = good.into_iter().partition(is_simpler);
            if good.is_empty() {
                // An exchange may make other effects redundant.
                other.sort_by(|a, b| a.loss().total_cmp(&b.loss()));
                let few = problem.settings.select.simplified_exchanges;
                let few = other.iter().take(few);
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

    /// The smallest set of a trial's effects that explains the logs as well as the best one, among the sets that
    /// predicted losses suggest.
    fn least(&self, trial: &Trial, best: &Trial) -> Trial {
        let problem = self.problem;
        let Some(screening) = Screening::of(problem, &trial.fitted, &[]) else {
            return trial.clone();
        };
        let all = screening.present();
        let mut unshifted = all.clone();
        unshifted.retain(|&item| screening.items[item].shifted().is_none());
        let mut sets: Vec<_> = [descent(&screening, all), vec![unshifted.clone()]].concat();
        sets.extend(descent(&screening, unshifted));
        sets.retain(|set| self.is_promising(&screening, set, best));
        let mut sets: Vec<_> = sets.iter().map(|set| screening.effects(set)).collect();
        let shifts =
            |set: &[FittedEffect]| set.iter().filter(|own| own.shifted().is_some()).count();
        sets.sort_by_key(|set| (set.len(), shifts(set)));
        // The smallest that is as good is wanted: larger ones need no fit.
        let few = sets.chunks(rayon::current_num_threads());
        let mut good = few.map(|few| self.as_good_as(best, trial, few.to_vec()));
        let good = good.find(|good| !good.is_empty()).unwrap_or_default();
        let size = |trial: &Trial| (trial.fitted.model.effects.len(), trial.shifts());
        let least = good.into_iter().min_by_key(size);
        least.unwrap_or_else(|| trial.clone())
    }

    /// Whether a set may explain the logs as well as the best one, as its predicted loss has it.
    fn is_promising(&self, screening: &Screening, set: &[usize], best: &Trial) -> bool {
        let loss = screening.loss(set).unwrap_or(f64::INFINITY);
        loss <= self.promising_below(best)
    }

    /// The largest predicted loss of a set that may explain the logs as well as the best one.
    fn promising_below(&self, best: &Trial) -> f64 {
        let settings = &self.problem.settings.select;
        best.loss() * (1.0 + settings.prediction_slack * settings.simpler_rise)
    }

    /// The sets without one of a trial's effects that may explain the logs as well as the best one.
    fn without_one(&self, trial: &Trial, best: &Trial) -> Vec<Vec<FittedEffect>> {
        let screening = Screening::of(self.problem, &trial.fitted, &[]);
        let added = trial.added(self.problem);
        let is_promising = |k: &usize| {
            let all = 0..added.len();
            let set: Vec<usize> = all.filter(|other| other != k).collect();
            let predicted = screening.as_ref();
            predicted.is_none_or(|screening| self.is_promising(screening, &set, best))
        };
        let without = |k: usize| [&added[..k], &added[k + 1..]].concat();
        let promising = (0..added.len()).filter(is_promising);
        promising.map(without).collect()
    }

    /// The sets that explain the logs as well as the best one, fitted from a trial.
    fn as_good_as(&self, best: &Trial, from: &Trial, sets: Vec<Vec<FittedEffect>>) -> Vec<Trial> {
        let settings = &self.problem.settings.select;
        let mut trials = self.fitted(from, sets, best.loss() * (1.0 + settings.simpler_rise));
        trials.retain(|trial| trial.is_as_good_as(best, settings));
        trials
    }

    /// The declared model with a set of effects in place of a trial's, fitted at the trial's scale to a loss of
    /// `below`, if time is left.
    fn fitted_from(&self, from: &Trial, set: &[FittedEffect], below: f64) -> Option<Trial> {
        if self.watch.has_to_end() {
            return None;
        }
        let problem = self.problem;
        let effects = [problem.declared.effects.as_slice(), set].concat();
        let fitted = problem.with_better_effects(&from.fitted, effects, below)?;
        Some(Trial::of(problem, fitted))
    }

    /// A trial in which the effects whose values are not consistent are replaced by those that they contain, fitted
    /// from there to a loss of `below`; `None` if all are consistent, or if no valid set results.
    fn repaired_from(&self, trial: &Trial, below: f64) -> Option<Trial> {
        let problem = self.problem;
        if trial.is_consistent(problem) {
            return None;
        }
        let declared = &problem.declared.effects;
        let set = repaired(problem, declared, trial.added(problem));
        let found = self.fitted_from(trial, &set, below);
        found.filter(|found| found.is_valid(problem))
    }

    /// A trial in which what logs need not determine of its effects is held, fitted from there to a loss of `below`; `None`
    /// if there is nothing of the kind, if other effects are not determined beside it either, which would make up for
    /// where it is held, or if no valid set results.
    fn with_unknown_held(&self, trial: &Trial, below: f64) -> Option<Trial> {
        let problem = self.problem;
        let added = trial.added(problem);
        let held: Vec<_> = added.iter().map(FittedEffect::with_unknown_held).collect();
        held.iter().flatten().next()?;
        if !trial.determines_what_is_not_held(problem) {
            return None;
        }
        let set = held.into_iter().zip(added);
        let set = set.map(|(held, as_it_is)| held.unwrap_or_else(|| as_it_is.clone()));
        let found = self.fitted_from(trial, &set.collect::<Vec<_>>(), below);
        found.filter(|found| found.is_valid(problem))
    }
}

/// Drop items whose key is in `met` or belongs to an earlier item.
fn first_of_each<T>(
    items: &mut Vec<T>,
    mut met: Vec<Vec<EffectId>>,
    key: impl Fn(&T) -> Vec<EffectId>,
) {
    items.retain(|item| {
        let key = key(item);
        let is_new = !met.contains(&key);
        met.push(key);
        is_new
    });
}

/// Drop effects that another effect of the set contains.
fn without_contained(set: &mut Vec<FittedEffect>) {
    let all = set.clone();
    set.retain(|part| !all.iter().any(|whole| whole.contains(part)));
}
