use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};

use super::candidate::{best_start, candidates};
use super::folds::{folds, left_out_losses};
use super::study::{Fitted, Study};
use crate::identify::uncertainty;
use crate::model::{Effect, EffectParameter, FittedEffect};

/// What speaks for one candidate in one round.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// The model with this candidate, fitted.
    pub model: Fitted,
    /// The candidate with its fitted values.
    pub effect: FittedEffect,
    /// Fall of the loss on stretches left out of the fit, as a share of what it was.
    pub gain: f64,
    /// Probability of such evidence without the effect.
    pub p_value: f64,
    /// The loss on each left-out stretch.
    losses: Vec<f64>,
}

/// One round of the search: what was tried beside the model at hand, best first.
#[derive(Debug, Clone)]
pub struct Round {
    /// Number of candidates that were looked at.
    pub candidates: usize,
    /// Those that promised most, fitted, best first.
    pub evidence: Vec<Evidence>,
    /// Index of the one that was added.
    pub chosen: Option<usize>,
}

/// The outcome of the search.
#[derive(Debug, Clone)]
pub struct Selection {
    pub model: Fitted,
    pub rounds: Vec<Round>,
}

/// Probability of a false alarm that the search admits, over all candidates of a round.
const FALSE_ALARM: f64 = 0.01;
/// An effect must lower the loss on left-out stretches by this share, the error itself thus by a twentieth: less
/// is of no use to anyone, and on real rigs it is what a wrong effect saves by standing in for others.
const WORTHWHILE: f64 = 0.1;
/// Candidates that are fitted after all have been screened.
const FITTED: usize = 8;
/// Effects that one search adds at most.
pub const MOST_EFFECTS: usize = 6;
/// Candidates within this many standard errors of the best explain the logs as well as it does.
const AS_GOOD: f64 = 2.0;

/// Add effects of the library one by one while the loss on trajectories that are left out of the fit falls
/// significantly. `progress` is told what is being tried.
pub fn select(
    study: &Study<'_>,
    library: &[Effect],
    declared: Fitted,
    progress: &mut dyn FnMut(&str),
) -> Selection {
    let folds = folds(&study.shooting);
    let mut selection = Selection {
        model: declared,
        rounds: Vec::new(),
    };
    while selection.rounds.len() < MOST_EFFECTS {
        let round = round(study, library, &selection.model, &folds, progress);
        let next = round
            .chosen
            .map(|chosen| round.evidence[chosen].model.clone());
        selection.rounds.push(round);
        let Some(next) = next else { break };
        // The scale of the residuals has fallen: the next round looks with sharper eyes.
        selection.model = rescaled(study, &next);
        selection.model = simplified(study, library, selection.model, &folds);
    }
    selection
}

/// Whether some value of a parameter switches the effect off, so that it can start from absent.
fn has_switch(candidate: &FittedEffect) -> bool {
    candidate
        .effect
        .parameters
        .iter()
        .any(EffectParameter::is_switch)
}

fn rescaled(study: &Study<'_>, model: &Fitted) -> Fitted {
    study
        .refit(
            &model.effects,
            &model.declared,
            model.fit.locals.clone(),
            None,
        )
        .unwrap_or_else(|_| model.clone())
}

fn round(
    study: &Study<'_>,
    library: &[Effect],
    model: &Fitted,
    folds: &[usize],
    progress: &mut dyn FnMut(&str),
) -> Round {
    let all = candidates(study, library, &model.effects);
    let mut screened: Vec<(FittedEffect, f64)> = Vec::new();
    for candidate in &all {
        progress(&format!(
            "{} on joint {}",
            candidate.effect.name,
            candidate.joint + 1
        ));
        let beside = beside(study, model, candidate);
        screened.extend(beside.and_then(|beside| best_start(study, &beside, candidate)));
    }
    // A step that starts far from "absent" promises little truth: such candidates are always fitted.
    screened.sort_by(|a, b| {
        has_switch(&a.0)
            .cmp(&has_switch(&b.0))
            .then(a.1.total_cmp(&b.1))
    });
    screened.truncate(FITTED);
    let losses = left_out_losses(&model.fit, folds);
    let mut evidence: Vec<Evidence> = screened
        .into_iter()
        .filter_map(|(start, _)| {
            progress(&format!(
                "fitting {} on joint {}",
                start.effect.name,
                start.joint + 1
            ));
            weigh(study, model, start, folds, &losses)
        })
        .collect();
    evidence.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Round {
        candidates: all.len(),
        chosen: choose(&evidence, all.len()),
        evidence,
    }
}

/// The model that a candidate joins: without the simpler effects that it contains, unless the file declares
/// them. `None` if the model has
/// an effect that contains the candidate.
fn beside(study: &Study<'_>, model: &Fitted, candidate: &FittedEffect) -> Option<Fitted> {
    let contains = |a: &FittedEffect, b: &FittedEffect| {
        a.joint == b.joint && a.effect.contains.contains(&b.effect.name)
    };
    if model
        .effects
        .iter()
        .any(|present| contains(present, candidate))
    {
        return None;
    }
    let mut beside = model.clone();
    let found = beside.effects.split_off(study.system.effects.len());
    beside.effects.extend(
        found
            .into_iter()
            .filter(|present| !contains(candidate, present)),
    );
    Some(beside)
}

/// Fit a candidate and judge it.
fn weigh(
    study: &Study<'_>,
    model: &Fitted,
    start: FittedEffect,
    folds: &[usize],
    before: &[f64],
) -> Option<Evidence> {
    let mut effects = beside(study, model, &start)?.effects;
    effects.push(start);
    let scale = Some(model.fit.scale);
    let fitted = study
        .refit(&effects, &model.declared, model.fit.locals.clone(), scale)
        .ok()?;
    let losses = left_out_losses(&fitted.fit, folds);
    let total: f64 = before.iter().sum();
    let gain = 1.0 - losses.iter().sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let effect = fitted.effects.last().cloned()?;
    let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
    if !effect.effect.is_valid(&values) {
        return None;
    }
    let p_value = p_value(study, &fitted, fitted.effects.len() - 1)
        .unwrap_or_else(|| p_of_gains(before, &losses));
    Some(Evidence {
        model: fitted,
        effect,
        gain,
        p_value,
        losses,
    })
}

/// Index of the evidence to act upon: of all candidates that are significant, worthwhile and as good as the
/// best, the one with the fewest parameters.
fn choose(evidence: &[Evidence], candidates: usize) -> Option<usize> {
    #[allow(clippy::cast_precision_loss)] // few candidates
    let level = FALSE_ALARM / candidates.max(1) as f64;
    let sound = |e: &Evidence| e.p_value < level && e.gain > WORTHWHILE;
    let best = evidence.iter().find(|e| sound(e))?;
    (0..evidence.len())
        .filter(|&i| sound(&evidence[i]) && evidence[i].is_as_good_as(best))
        .min_by_key(|&i| evidence[i].effect.values.len())
}

impl Evidence {
    /// Whether the losses on left-out stretches do not tell this candidate from a better one.
    pub fn is_as_good_as(&self, best: &Self) -> bool {
        let (mean, error) = mean_and_error(&differences(&self.losses, &best.losses));
        // Where both cut the loss to a sliver, differences of slivers do not matter either.
        mean <= AS_GOOD * error && self.gain > 0.8 * best.gain
    }
}

/// Probability, by the cluster-robust Wald test, of the fitted values of the k-th effect if it were absent.
/// `None` for an effect that no value of a parameter switches off.
pub fn p_value(study: &Study<'_>, model: &Fitted, k: usize) -> Option<f64> {
    let effect = &model.effects[k].effect;
    let range = model.range_of(k);
    let switches: Vec<usize> = (0..effect.parameters.len())
        .filter(|&i| effect.parameters[i].is_switch())
        .filter_map(|i| {
            model
                .fit
                .active
                .iter()
                .position(|&active| active == range.start + i)
        })
        .collect();
    if switches.is_empty() {
        return None;
    }
    let uncertainty = uncertainty(&study.shooting, &model.fit);
    let covariance = uncertainty
        .covariance
        .select_rows(&switches)
        .select_columns(&switches);
    let values = nalgebra::DVector::from_iterator(
        switches.len(),
        switches
            .iter()
            .map(|&i| model.fit.values[model.fit.active[i]]),
    );
    let inverse = covariance.pseudo_inverse(1e-300).ok()?;
    let statistic = values.dot(&(inverse * &values));
    Some(f_test(statistic, switches.len(), uncertainty.blocks))
}

/// Hotelling's form of the F test: a quadratic form in estimates whose covariance comes from few blocks.
#[allow(clippy::cast_precision_loss)] // few blocks
fn f_test(statistic: f64, restrictions: usize, blocks: usize) -> f64 {
    let (q, freedom) = (restrictions as f64, blocks as f64 - restrictions as f64);
    if freedom < 1.0 {
        return 1.0;
    }
    let f = statistic * freedom / (q * (blocks as f64 - 1.0));
    FisherSnedecor::new(q, freedom).map_or(1.0, |law| law.sf(f))
}

/// One-sided signed-rank test (Wilcoxon 1945) of the fall in loss over the left-out stretches, in its normal
/// approximation: effects that act in a few fast stretches give falls with tails too heavy for a t-test.
#[allow(clippy::cast_precision_loss)] // few stretches
pub fn p_of_gains(before: &[f64], after: &[f64]) -> f64 {
    let mut falls = differences(before, after);
    falls.retain(|fall| *fall != 0.0);
    falls.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let count = falls.len() as f64;
    let ranks = falls.iter().zip(1..).filter(|(fall, _)| **fall > 0.0);
    let sum: f64 = ranks.map(|(_, rank)| f64::from(rank)).sum();
    let mean = count * (count + 1.0) / 4.0;
    let deviation = (count * (count + 1.0) * (2.0 * count + 1.0) / 24.0).sqrt();
    if deviation == 0.0 {
        return 1.0;
    }
    // Half a rank less, since ranks are whole numbers and the normal law is not.
    Normal::standard().sf((sum - 0.5 - mean) / deviation)
}

fn differences(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

#[allow(clippy::cast_precision_loss)] // few stretches
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean, (variance / count).sqrt())
}

/// Drop effects that a later one has made needless, or put simpler ones in their place that now do as well.
fn simplified(study: &Study<'_>, library: &[Effect], model: Fitted, folds: &[usize]) -> Fitted {
    let with: f64 = left_out_losses(&model.fit, folds).iter().sum();
    for effects in simpler(library, &model.effects, study.system.effects.len()) {
        let scale = Some(model.fit.scale);
        let locals = model.fit.locals.clone();
        let Ok(less) = study.refit(&effects, &model.declared, locals, scale) else {
            continue;
        };
        let without: f64 = left_out_losses(&less.fit, folds).iter().sum();
        if without < with * (1.0 + 0.5 * WORTHWHILE) {
            return simplified(study, library, less, folds);
        }
    }
    model
}

/// Every set of effects that is one step simpler: one effect less, or one replaced by some of those that it
/// contains, fewest first. The first `declared` ones stay.
fn simpler(
    library: &[Effect],
    effects: &[FittedEffect],
    declared: usize,
) -> Vec<Vec<FittedEffect>> {
    let mut all = Vec::new();
    for k in declared..effects.len() {
        let mut without = effects.to_vec();
        let old = without.remove(k);
        for parts in parts_of(library, &old.effect) {
            let parts = parts
                .into_iter()
                .map(|effect| FittedEffect::absent(effect, old.joint));
            let mut replaced = without.clone();
            replaced.splice(k..k, parts);
            all.push(replaced);
        }
        // The effect that came last is what the round was about: it is replaced at most.
        if k + 1 < effects.len() {
            all.insert(0, without);
        }
    }
    all
}

/// The sets of effects contained in one that have fewer parameters together, fewest first.
fn parts_of<'l>(library: &'l [Effect], whole: &Effect) -> Vec<Vec<&'l Effect>> {
    let is_part = |effect: &&Effect| whole.contains.contains(&effect.name);
    let parts: Vec<&Effect> = library.iter().filter(is_part).collect();
    let chosen = |set: usize| -> Vec<&Effect> {
        let members = parts
            .iter()
            .enumerate()
            .filter(|(bit, _)| set >> bit & 1 == 1);
        members.map(|(_, effect)| *effect).collect()
    };
    let size = |set: &Vec<&Effect>| {
        set.iter()
            .map(|effect| effect.parameters.len())
            .sum::<usize>()
    };
    let mut sets: Vec<Vec<&Effect>> = (1..1_usize << parts.len()).map(chosen).collect();
    sets.retain(|set| size(set) < whole.parameters.len());
    sets.sort_by_key(size);
    sets
}
