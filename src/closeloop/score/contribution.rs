use rayon::prelude::*;

use super::errors::Scorer;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::refine::Refined;
use crate::closeloop::select::{folds, left_out_losses, p_of_gains, p_value};
use crate::closeloop::study::Study;
use crate::model::{FittedEffect, Model, OwnValue, Parameter};
use crate::sim::metric::Assessment;

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
    (declared..refined.model.effects.len())
        .into_par_iter()
        .filter_map(|k| finding(study, &refined.model, scorer, with, k))
        .collect()
}

fn finding(
    study: &Study<'_>,
    model: &Fitted,
    scorer: &Scorer<'_>,
    with: &Assessment,
    k: usize,
) -> Option<Finding> {
    let (expression, parameters) = described(study.system, model, k);
    let without = without(study, model, k)?;
    let folds = folds(&study.shooting);
    let losses = |model: &Fitted| left_out_losses(&model.fit, &folds);
    Some(Finding {
        expression,
        effect: model.effects[k].clone(),
        parameters,
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

/// What the k-th effect of a model adds, and the parameters that it is reported with: of a shift, what is shifted.
fn described(declared: &Model, model: &Model, k: usize) -> (String, Vec<Parameter>) {
    let effect = &model.effects[k];
    match effect.shifted() {
        Some(shifted) => {
            let actual = model.absorbed().parameters.swap_remove(shifted);
            let expression = declared.parameters[shifted].expression_of_shift(actual.value);
            (expression, vec![actual])
        }
        None => {
            let own = model.all_parameters()[model.place_of(k)].to_vec();
            let names: Vec<String> = own.iter().map(|p| p.name.clone()).collect();
            (effect.expression(&names), own)
        }
    }
}

/// The model refitted without its k-th effect, its residuals on the same scale.
fn without(study: &Study<'_>, model: &Fitted, k: usize) -> Option<Fitted> {
    let mut less = model.model.clone();
    less.effects.remove(k);
    let locals = model.fit.locals.clone();
    study.refit(&less, locals, Some(model.fit.scale)).ok()
}
