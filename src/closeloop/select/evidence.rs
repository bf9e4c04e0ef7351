use statrs::distribution::{ContinuousCDF, FisherSnedecor, Normal};

use super::folds::left_out_losses;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::settings::SelectSettings;
use crate::closeloop::study::Study;
use crate::data::statistics::{mean, standard_error};
use crate::identify::uncertainty;
use crate::model::FittedEffect;

/// The evidence for one candidate beside the effects that a model already has.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// The model with this candidate, fitted.
    pub fitted: Fitted,
    /// The candidate with its fitted values.
    pub effect: FittedEffect,
    /// Fall of the loss on stretches left out of the fit, as a share of what it was.
    pub gain: f64,
    /// Probability of such evidence without the effect.
    pub p_value: f64,
    /// The loss on each left-out stretch.
    pub(super) losses: Vec<f64>,
}

impl Evidence {
    /// Number of values, one a log where they differ by log, then of the simpler effects that it contains.
    pub(super) fn complexity(&self) -> (usize, usize) {
        let Fitted { model, fit } = &self.fitted;
        let range = model.place_of(model.effects.len() - 1);
        let columns = fit.columns.iter();
        let of_logs = columns.filter(|c| c.log.is_some() && range.contains(&c.parameter));
        let per_log = (self.effect.effect.parameters.iter()).filter(|p| p.per_log);
        let values = range.len() - per_log.count() + of_logs.count();
        (values, self.effect.effect.contains.len())
    }

    /// Judge a model whose last effect is the candidate against the one without it, by their losses on left-out stretches.
    /// `None` where the fitted values are inconsistent with each other.
    pub(super) fn of(study: &Study<'_>, fitted: Fitted, without: &[f64]) -> Option<Self> {
        let effect = fitted.model.effects.last().cloned()?;
        let values: Vec<f64> = effect.values.iter().map(|(value, _)| *value).collect();
        if !effect.effect.is_valid(&values) {
            return None;
        }
        let losses = left_out_losses(study, &fitted.fit);
        let p_value = p_value(study, &fitted, fitted.model.effects.len() - 1)
            .unwrap_or_else(|| p_of_gains(without, &losses));
        Some(Self {
            gain: gain(without, &losses),
            p_value,
            effect,
            fitted,
            losses,
        })
    }

    /// Whether the losses on left-out stretches do not distinguish this candidate from a better one.
    pub fn is_as_good_as(&self, best: &Self, settings: &SelectSettings) -> bool {
        let differences = differences(&self.losses, &best.losses);
        mean(&differences) <= settings.as_good * standard_error(&differences)
            && self.gain > settings.as_much * best.gain
            && 1.0 - self.gain <= settings.as_little * (1.0 - best.gain)
    }
}

/// Fall of the loss as a share of what it was.
pub fn gain(before: &[f64], after: &[f64]) -> f64 {
    1.0 - after.iter().sum::<f64>() / before.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Probability, by the cluster-robust Wald test, of the fitted values of the k-th effect if it were absent.
/// `None` for an effect that no value of a parameter switches off.
pub fn p_value(study: &Study<'_>, fitted: &Fitted, k: usize) -> Option<f64> {
    let effect = &fitted.model.effects[k].effect;
    let range = fitted.model.place_of(k);
    let is_switch = |parameter: usize| {
        range.contains(&parameter) && effect.parameters[parameter - range.start].is_switch()
    };
    let columns = &fitted.fit.columns;
    let switches: Vec<usize> = (0..columns.len())
        .filter(|&i| is_switch(columns[i].parameter))
        .collect();
    if switches.is_empty() {
        return None;
    }
    let uncertainty = uncertainty(&study.shooting, &fitted.fit);
    let covariance = uncertainty
        .covariance
        .select_rows(&switches)
        .select_columns(&switches);
    let values = nalgebra::DVector::from_iterator(
        switches.len(),
        switches.iter().map(|&i| {
            let log = columns[i].log.map(|log| &study.logs[log]);
            fitted.model.value_of(columns[i].parameter, log)
        }),
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
    // Values without a spread, as on a joint at rest, say nothing.
    if !f.is_finite() {
        return 1.0;
    }
    FisherSnedecor::new(q, freedom).map_or(1.0, |law| law.sf(f))
}

/// One-sided signed-rank test (Wilcoxon 1945) of the fall in loss over stretches, in its normal
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
