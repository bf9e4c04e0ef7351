//! The outcome of closing the loop, in the bench's own types.

use super::hidden::{Label, label};
use super::judge::{Answer, Estimate, Named, of_log};
use residyn_core::closeloop::{Finding, Outcome};
use residyn_core::model::{FittedEffect, Parameter};

/// The answer in an outcome.
pub fn answer(outcome: &Outcome) -> Answer {
    let of_effects: Vec<&str> = outcome
        .effects
        .findings
        .iter()
        .flat_map(|finding| &finding.parameters)
        .map(|parameter| parameter.name.as_str())
        .collect();
    let is_declared = |parameter: &&Parameter| !of_effects.contains(&parameter.name.as_str());
    let set = |effects: &[FittedEffect]| effects.iter().map(label_of).collect();
    Answer {
        verdict: outcome.verdict,
        reason: outcome.reason.clone(),
        named: outcome.effects.findings.iter().map(named).collect(),
        alternatives: outcome
            .effects
            .alternatives
            .iter()
            .map(|alternative| set(&alternative.effects))
            .collect(),
        declared: (outcome
            .models
            .after
            .model
            .absorbed()
            .all_parameters()
            .iter())
        .filter(is_declared)
        .map(|parameter| Estimate::of(&parameter.name, parameter))
        .collect(),
        left: outcome.diagnostics.unexplained.fraction,
        left_p_value: outcome.diagnostics.unexplained.p_value,
        left_where: outcome.diagnostics.unexplained.place.clone(),
    }
}

fn named(finding: &Finding) -> Named {
    Named {
        label: label_of(&finding.effect),
        parameters: estimates(&finding.effect, &finding.parameters),
        p_value: finding.p_value,
        error_reduction: finding.error_reduction.as_ref().ok().copied(),
    }
}

/// The numbers of an effect, named as in its file; `found` are its parameters in the model.
pub fn estimates(effect: &FittedEffect, found: &[Parameter]) -> Vec<Estimate> {
    let own = &effect.effect.parameters;
    let common = own.iter().zip(found);
    let common = common.filter(|(_, found)| !found.per_log);
    let single = effect.own.iter().map(|in_log| Estimate {
        name: of_log(&own[in_log.parameter].name, &in_log.log_name()),
        value: in_log.value,
        ci95: in_log.ci95,
    });
    common
        .map(|(own, found)| Estimate::of(&own.name, found))
        .chain(single)
        .collect()
}

pub fn label_of(effect: &FittedEffect) -> Label {
    let (name, parameters) = (&effect.effect.name, &effect.effect.parameters);
    label(name, effect.joint, &parameters[0].name)
}

impl Estimate {
    pub fn of(name: &str, parameter: &Parameter) -> Self {
        Self {
            name: name.to_owned(),
            value: parameter.value,
            ci95: parameter.ci95,
        }
    }
}
