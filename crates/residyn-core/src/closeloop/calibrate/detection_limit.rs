use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::Named;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::select::{Folds, candidates, left_out_losses, starts};
use crate::closeloop::settings::Settings;
use crate::identify::{Fit, FitError, as_it_stands, fit, squared_distance, uncertainty};
use crate::model::FittedEffect;

/// The smallest size of an effect, and what the search named when the effect was hidden in simulated logs.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectionLimit {
    /// The effect, absent.
    pub effect: FittedEffect,
    pub smallest: Smallest,
    /// What was named with the effect at a multiple of that size; `None` if it was not tried.
    pub named: Option<Vec<Named>>,
}

impl DetectionLimit {
    /// Whether the hidden effect was named; `None` if it was not tried.
    pub fn verified(&self) -> Option<bool> {
        let this = Named::of(&self.effect);
        self.named.as_ref().map(|named| named.contains(&this))
    }
}

/// The smallest size of one effect that the search would name.
#[derive(Debug, Clone, PartialEq)]
pub enum Smallest {
    /// One switch alone, the one that shows at the smallest multiple of its typical value; with the values of all
    /// parameters, inner ones at the tried values that show the effect best, other switches at zero.
    Detectable { switch: usize, values: Vec<f64> },
    /// None: the motion does not distinguish it from what the model has.
    Indistinguishable,
    /// No parameter at zero switches the effect off, so that its size has no natural zero.
    NotComputed,
    /// The model diverges with the effect.
    Diverged,
}

/// For each effect that could join an accepted model, the smallest size that the search would name.
///
/// # Errors
/// A model that diverges on the logs.
pub(super) fn detection_limits(
    problem: &Problem<'_>,
    accepted: &Fitted,
) -> Result<Vec<DetectionLimit>, FitError> {
    let baseline = Baseline::new(problem, accepted)?;
    let all = candidates(problem, &accepted.model.effects);
    let trials: usize = all.iter().map(|candidate| starts(candidate).len()).sum();
    let level = problem.settings.establish.false_alarm / trials.max(1) as f64;
    let limit = |effect: FittedEffect| DetectionLimit {
        smallest: baseline.size(&effect, level),
        effect,
        named: None,
    };
    Ok(all.into_iter().map(limit).collect())
}

/// An accepted model on the logs that effects are chosen by.
struct Baseline<'a> {
    problem: &'a Problem<'a>,
    accepted: &'a Fitted,
    start_states: Vec<Vec<f64>>,
    /// The loss on blocks left out of the fit.
    loss: f64,
}

impl<'a> Baseline<'a> {
    fn new(problem: &'a Problem<'a>, accepted: &'a Fitted) -> Result<Self, FitError> {
        let (dynamics, shooting) = (accepted.model.dynamics(), &problem.shooting);
        let scale = accepted.fit.scale;
        let states = shooting.initial_start_states(0);
        let (_, free) = fit(shooting, &dynamics, &[], states, Some(scale))?;
        let (active, start_states) = (&accepted.fit.active, free.start_states);
        let fit = as_it_stands(shooting, &dynamics, active, start_states.clone(), scale)?;
        let loss = left_out_losses(&Folds::of(problem), &fit).iter().sum();
        Ok(Self {
            problem,
            accepted,
            start_states,
            loss,
        })
    }

    fn size(&self, candidate: &FittedEffect, level: f64) -> Smallest {
        let parameters = &candidate.effect.parameters;
        let switches: Vec<usize> = (0..parameters.len())
            .filter(|&i| parameters[i].is_switch())
            .collect();
        if switches.is_empty() {
            return Smallest::NotComputed;
        }
        // A per-log value is taken to be the same in all logs, but one value per log is tested.
        let tested = match parameters.iter().any(|p| p.per_log) {
            true => switches.len() * self.problem.logs.len(),
            false => switches.len(),
        };
        let mut common = candidate.clone();
        for parameter in &mut common.effect.parameters {
            parameter.per_log = false;
        }
        let starts = starts(&common);
        let mut none = Smallest::Indistinguishable;
        let tried = starts
            .iter()
            .flat_map(|start| switches.iter().map(move |&switch| (start, switch)));
        let sizes: Vec<(usize, Vec<f64>)> = tried
            .filter_map(|(start, switch)| {
                let Ok(fit) = self.with(start, switch) else {
                    none = Smallest::Diverged;
                    return None;
                };
                let mut values: Vec<f64> = start.values.iter().map(|(value, _)| *value).collect();
                values[switch] = self.smallest_by(&fit, tested, level)?;
                (candidate.effect.is_valid(&values)).then_some((switch, values))
            })
            .collect();
        let multiple =
            |(switch, values): &(usize, Vec<f64>)| values[*switch] / parameters[*switch].typical;
        (sizes.into_iter())
            .min_by(|a, b| multiple(a).total_cmp(&multiple(b)))
            .map_or(none, |(switch, values)| Smallest::Detectable {
                switch,
                values,
            })
    }

    /// The smallest size of the last free value of a fit, in a test of all `switches`; `None` if the motion does not distinguish it from the others.
    fn smallest_by(&self, fit: &Fit, switches: usize, level: f64) -> Option<f64> {
        let Settings {
            establish: settings,
            calibrate,
            ..
        } = &self.problem.settings;
        let power = calibrate.power_quantile;
        let information = own_information(fit, calibrate.own_information)?;
        let known = uncertainty(&self.problem.shooting, fit);
        let last = fit.columns.len() - 1;
        let deviation = known.covariance[(last, last)].sqrt();
        let needed = |p: f64, gain: f64| {
            let significant = critical(p, switches, known.blocks)? * deviation;
            let worthwhile = (2.0 * self.loss * gain / (1.0 - gain) / information).sqrt();
            Some(significant.max(worthwhile) + power * deviation)
        };
        let plain = needed(settings.uncorrected_false_alarm, settings.plain_gain)?;
        Some(needed(level, settings.worthwhile_gain)?.min(plain))
    }

    /// The accepted model with one more free value, a switch of the effect, at zero.
    fn with(&self, start: &FittedEffect, switch: usize) -> Result<Fit, FitError> {
        let accepted = self.accepted;
        let dynamics = self.problem.extended(accepted, std::slice::from_ref(start));
        let switch = dynamics.parameters.len() - start.values.len() + switch;
        as_it_stands(
            &self.problem.shooting,
            &dynamics,
            &[accepted.fit.active.as_slice(), &[switch]].concat(),
            self.start_states.clone(),
            accepted.fit.scale,
        )
    }
}

/// Information on the last free value, the others free as well; `None` if it is no more than rounding error.
fn own_information(fit: &Fit, least: f64) -> Option<f64> {
    let last = fit.columns.len() - 1;
    let all = fit.equations().hessian;
    let others = all.view((0, 0), (last, last)).into_owned();
    let cross = all.column(last).rows(0, last).into_owned();
    let own = 1.0 - squared_distance(&others, &cross) / all[(last, last)];
    (own > least && all[(last, last)] > 0.0).then(|| own * all[(last, last)])
}

/// Standard deviations from zero at which one of `switches` switches is significant at level `p`: the threshold of
/// Hotelling's test. `None` for too few blocks.
fn critical(p: f64, switches: usize, blocks: usize) -> Option<f64> {
    let (q, freedom) = (switches as f64, blocks as f64 - switches as f64);
    let law = FisherSnedecor::new(q, freedom).ok()?;
    let f = law.inverse_cdf(1.0 - p);
    Some((f * q * (blocks as f64 - 1.0) / freedom).sqrt())
}
