use rayon::prelude::*;

use super::errors::Scorer;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::per_log::take_over_intervals;
use crate::closeloop::refine::Refined;
use crate::closeloop::select::{folds, left_out_losses, p_of_gains, p_value};
use crate::closeloop::study::Study;
use crate::evaluate::Assessment;
use crate::identify::{Uncertainty, uncertainty};
use crate::model::{FittedEffect, OwnValue, Parameter, System};

/// One effect that was added.
#[derive(Debug, Clone)]
pub struct Finding {
    pub effect: FittedEffect,
    pub expression: String,
    /// With intervals.
    pub parameters: Vec<Parameter>,
    pub p_value: f64,
    /// Share of the position error that this effect alone takes away, by a refit without it.
    pub error_reduction: f64,
}

impl Finding {
    /// What it says of each parameter: its value or, where it has one per log, its values in single logs.
    pub fn rows(&self) -> Vec<(Parameter, Option<&OwnValue>)> {
        let of_parameter = |(k, parameter): (usize, &Parameter)| {
            if !parameter.per_log {
                return vec![(parameter.clone(), None)];
            }
            let own = self.effect.own.iter().filter(|own| own.parameter == k);
            own.map(|own| {
                let parameter = Parameter {
                    value: own.value,
                    ci95: own.ci95,
                    ..parameter.clone()
                };
                (parameter, Some(own))
            })
            .collect()
        };
        let all = self.parameters.iter().enumerate();
        all.flat_map(of_parameter).collect()
    }
}

/// The effects that were added to the declared model, each with what it contributes. `with` is the error of the model
/// with all of them.
pub(in crate::closeloop) fn findings(
    study: &Study<'_>,
    refined: &Refined<'_>,
    scorer: &Scorer<'_>,
    with: &Assessment,
) -> Vec<Finding> {
    let declared = study.system.effects.len();
    let uncertainty = uncertainty(&study.shooting, &refined.model.fit);
    (declared..refined.model.effects.len())
        .into_par_iter()
        .filter_map(|k| finding(study, refined, &uncertainty, scorer, with, k))
        .collect()
}

fn finding(
    study: &Study<'_>,
    refined: &Refined<'_>,
    uncertainty: &Uncertainty,
    scorer: &Scorer<'_>,
    with: &Assessment,
    k: usize,
) -> Option<Finding> {
    let Refined {
        model, parameters, ..
    } = refined;
    let own = parameters[model.range_of(k)].to_vec();
    let mut effect = model.effects[k].clone();
    let (expression, reported) = described(study.system, &effect, parameters, &own);
    for (slot, parameter) in effect.values.iter_mut().zip(&own) {
        *slot = (parameter.value, parameter.ci95);
    }
    take_over_intervals(
        &mut effect,
        model.range_of(k),
        &model.fit,
        uncertainty,
        study.logs,
    );
    let without = without(study, model, k)?;
    let folds = folds(&study.shooting);
    let losses = |model: &Fitted| left_out_losses(&model.fit, &folds);
    Some(Finding {
        expression,
        effect,
        parameters: reported,
        p_value: p_value(study, model, k)
            .unwrap_or_else(|| p_of_gains(&losses(&without), &losses(model))),
        error_reduction: 1.0
            - with.position_rms()
                / scorer
                    .fitted(&without)
                    .position_rms()
                    .max(f64::MIN_POSITIVE),
    })
}

/// What an effect with its `own` parameters adds, and the parameters that it is reported with: of a shift, what is
/// shifted.
fn described(
    system: &System,
    effect: &FittedEffect,
    parameters: &[Parameter],
    own: &[Parameter],
) -> (String, Vec<Parameter>) {
    match effect.shifted() {
        Some(k) => {
            let expression = system.parameters[k].expression_of_shift(parameters[k].value);
            (expression, vec![parameters[k].clone()])
        }
        None => {
            let names: Vec<String> = own.iter().map(|p| p.name.clone()).collect();
            (effect.expression(&names), own.to_vec())
        }
    }
}

/// The model refitted without its k-th effect, its residuals on the same scale.
fn without(study: &Study<'_>, model: &Fitted, k: usize) -> Option<Fitted> {
    let mut effects = model.effects.clone();
    effects.remove(k);
    study
        .refit(
            &effects,
            &model.declared,
            model.fit.locals.clone(),
            Some(model.fit.scale),
        )
        .ok()
}
