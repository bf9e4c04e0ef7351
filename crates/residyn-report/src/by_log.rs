//! The values of single logs, and the spread of a rig's values that follows from them, as parts of `report.json`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::json::parameter;
use super::schema::{Ends, ParameterEntry, ends};
use residyn_core::closeloop::{OfLog, Outcome};
use residyn_core::model::Parameter;

/// the model with effects, fitted to one training log alone
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct OfLogEntry {
    pub log: String,
    /// free parameters, of the declared equations and of effects
    pub parameters: Vec<ParameterEntry>,
    /// the error that is compared (open-loop position error at the middle horizon in rad or m, or relative torque
    /// error) on each training log in order; null if there is none, empty if there are many logs
    pub errors: Vec<Option<f64>>,
    /// why it could not be fitted
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// range of a value of the rig from run to run, for domain randomisation
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(super) struct RangeEntry {
    pub name: String,
    pub unit: String,
    pub value: f64,
    /// range of 95 % of runs: the interval of the fit, widened by the spread between logs beyond their own intervals,
    /// within the parameter's bounds; an open end is null
    #[serde(deserialize_with = "ends")]
    #[schemars(with = "Ends")]
    pub range: [f64; 2],
    /// that spread as a standard deviation; null if fewer than two logs determine the value
    pub between_logs: Option<f64>,
}

pub(super) fn by_log(outcome: &Outcome) -> Vec<OfLogEntry> {
    outcome.by_log.iter().map(of_log).collect()
}

fn of_log(one: &OfLog) -> OfLogEntry {
    let of_fit = one.fitted.as_ref().ok();
    let parameters = of_fit.map(|fitted| fitted.model.absorbed().all_parameters());
    let is_free = |p: &ParameterEntry| p.ci95.is_some();
    OfLogEntry {
        log: one.log.clone(),
        parameters: (parameters.iter().flatten())
            .filter(|parameter| !parameter.per_log)
            .map(parameter)
            .filter(is_free)
            .collect(),
        errors: (one.errors.iter())
            .map(|error| error.is_finite().then_some(*error))
            .collect(),
        failure: one.fitted.as_ref().err().map(ToString::to_string),
    }
}

/// Standard deviations from the middle of a 95 % interval to its ends.
const ENDS: f64 = 1.96;

/// The range of each free parameter, from the fit to all logs and the fits to single logs.
pub(super) fn ranges(outcome: &Outcome, by_log: &[OfLogEntry]) -> Vec<RangeEntry> {
    let parameters = outcome.models.after.model.absorbed().all_parameters();
    let range = |of_all: &Parameter| {
        let [low, high] = of_all.ci95?;
        let alone = by_log.iter().flat_map(|log| &log.parameters);
        let message: Vec<[f64; 2]> = alone
            .filter(|parameter| parameter.name == of_all.name)
            .filter_map(|parameter| Some([parameter.value, half_width(parameter.ci95?) / ENDS]))
            .collect();
        let between = between(&message);
        let [least, most] = of_all.bounds;
        let half = half_width([low, high]).hypot(ENDS * between.unwrap_or(0.0));
        Some(RangeEntry {
            name: of_all.name.clone(),
            unit: of_all.unit.clone(),
            value: of_all.value,
            range: [-half, half].map(|off| (of_all.value + off).clamp(least, most)),
            between_logs: between,
        })
    };
    let shared = parameters.iter().filter(|parameter| !parameter.per_log);
    shared.filter_map(range).collect()
}

pub(super) fn half_width([low, high]: [f64; 2]) -> f64 {
    0.5 * (high - low)
}

/// Standard deviation between values beyond their own uncertainties, each value given with its standard deviation
/// (DerSimonian and Laird 1986); `None` for fewer than two.
#[allow(clippy::cast_precision_loss)] // few logs
fn between(values: &[[f64; 2]]) -> Option<f64> {
    let weighed = values.iter().map(|[value, own]| (*value, own.powi(-2)));
    let weighed: Vec<(f64, f64)> = weighed.filter(|(_, weight)| weight.is_finite()).collect();
    if weighed.len() < 2 {
        return None;
    }
    let sum = |of: &dyn Fn(f64, f64) -> f64| weighed.iter().map(|(v, w)| of(*v, *w)).sum::<f64>();
    let weights = sum(&|_, weight| weight);
    let mean = sum(&|value, weight| weight * value) / weights;
    let beyond = sum(&|value, weight| weight * (value - mean).powi(2)) - (weighed.len() - 1) as f64;
    let variance = beyond / (weights - sum(&|_, weight| weight * weight) / weights);
    Some(variance.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::between;

    #[test]
    fn spread_beyond_the_own_intervals_is_found() {
        // Exact values: their own spread, with n - 1.
        let apart = between(&[[1.0, 1e-6], [2.0, 1e-6], [3.0, 1e-6]]).unwrap();
        assert!((apart - 1.0).abs() < 1e-6, "{apart}");
        assert_eq!(between(&[[1.0, 0.5], [1.2, 0.5]]), Some(0.0));
        assert_eq!(between(&[[1.0, 0.5]]), None);
    }
}
