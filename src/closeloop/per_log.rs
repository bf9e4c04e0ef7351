//! Values that single logs have of their own, on the way between effects, which name logs, and fits, which count
//! them.

use std::ops::Range;

use crate::data::Log;
use crate::identify::{Fit, Own, Uncertainty, Values};
use crate::model::{FittedEffect, OwnValue};

/// Declared values, then those of the effects: all parameters of the model, in its order, as they are in a log
/// without values of its own.
pub fn joined(declared: &[f64], effects: &[FittedEffect]) -> Vec<f64> {
    let of_effects = effects
        .iter()
        .flat_map(|effect| effect.values.iter().map(|(value, _)| *value));
    declared.iter().copied().chain(of_effects).collect()
}

/// Declared values and those of the effects, as a fit to `logs` takes them.
pub fn values_on(logs: &[Log], declared: &[f64], effects: &[FittedEffect]) -> Values {
    let mut own = Vec::new();
    let mut first = declared.len();
    for effect in effects {
        for known in &effect.own {
            let called = (0..logs.len()).filter(|&log| logs[log].is_called(&known.log));
            own.extend(called.map(|log| Own {
                log,
                parameter: first + known.parameter,
                value: known.value,
            }));
        }
        first += effect.values.len();
    }
    Values {
        common: joined(declared, effects),
        own,
    }
}

/// What a fit to `logs` found of the effect whose parameters stand at `range`, beside what is known of other logs.
pub(super) fn take_over(effect: &mut FittedEffect, range: Range<usize>, fit: &Fit, logs: &[Log]) {
    let elsewhere = |known: &OwnValue| !logs.iter().any(|log| log.is_called(&known.log));
    effect.own.retain(elsewhere);
    let found = fit.own.iter().filter(|own| range.contains(&own.parameter));
    effect.own.extend(found.map(|own| OwnValue {
        log: logs[own.log].path.display().to_string(),
        parameter: own.parameter - range.start,
        value: own.value,
        ci95: None,
    }));
}

/// The same with 95 % intervals.
pub(super) fn take_over_intervals(
    effect: &mut FittedEffect,
    range: Range<usize>,
    fit: &Fit,
    uncertainty: &Uncertainty,
    logs: &[Log],
) {
    take_over(effect, range.clone(), fit, logs);
    for (i, column) in fit.columns.iter().enumerate() {
        let Some(log) = column.log.filter(|_| range.contains(&column.parameter)) else {
            continue;
        };
        let k = column.parameter - range.start;
        let [low, high] = effect.effect.parameters[k].bounds;
        let half = uncertainty.half_width(i);
        let mut own = effect.own.iter_mut();
        let is_it = |own: &&mut OwnValue| own.parameter == k && logs[log].is_called(&own.log);
        if let Some(own) = own.find(is_it) {
            own.ci95 = Some([(own.value - half).max(low), (own.value + half).min(high)]);
        }
    }
}
