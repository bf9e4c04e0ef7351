//! `report.json`: the outcome with fixed names, for other programs.

use super::calibration::CalibrationEntry;
use super::schema::{
    AlternativeEntry, AuditEntry, CombinationEntry, ContenderEntry, ContradictedEntry, EffectEntry,
    EffectName, ErrorEntry, FilesEntry, FitEntry, FitsEntry, IdentifiabilityEntry, LogEntry,
    LogsEntry, ModelError, NormEntry, ParameterEntry, Report, TorqueEntry, TriedEntry,
    UnexplainedEntry,
};
use crate::closeloop::{
    Alternative, Contradicted, Finding, Outcome, ResidualForce, Round, TorqueErrors, Tried,
};
use crate::data::{Audit, Joint, Log};
use crate::identify::{Combination, Fit, FitError};
use crate::model::{FittedEffect, Model, Origin, OwnValue, Parameter};
use crate::sim::metric::{Assessment, Summary, summarise};

/// Names of the files in the folder of a report.
pub(super) const MODEL: &str = "model.toml";
pub(super) const TEXT: &str = "report.md";
pub(super) const CHECKPOINT: &str = "checkpoint";
pub(super) const PLOTS: [&str; 3] = ["predictions.svg", "residual.svg", "errors.svg"];

impl Report {
    /// The outcome of a run of this origin.
    pub fn new(outcome: &Outcome, origin: &Origin) -> Self {
        let model = outcome.models.after.model.absorbed();
        Self {
            schema: 1,
            version: env!("CARGO_PKG_VERSION"),
            seed: origin.seed,
            configuration: origin.config.clone(),
            settings: outcome.given.settings.clone(),
            system: model.name.clone(),
            joints: model.joints,
            joint_names: joint_names(&model),
            verdict: outcome.verdict,
            reason: outcome.reason.clone(),
            effects: outcome.effects.findings.iter().map(effect).collect(),
            alternatives: outcome
                .effects
                .alternatives
                .iter()
                .map(alternative)
                .collect(),
            supported: outcome.effects.supported.iter().map(effect).collect(),
            unexplained: left(outcome),
            parameters: model.parameters.iter().map(parameter).collect(),
            contradicted: outcome
                .models
                .contradicted
                .iter()
                .map(contradicted)
                .collect(),
            identifiability: identifiability(outcome),
            fits: FitsEntry {
                moved_to: (outcome.models.moved_to.iter())
                    .map(|parameter| (parameter.name.clone(), parameter.value))
                    .collect(),
                before: ended(&outcome.models.before.fit),
                after: ended(&outcome.models.after.fit),
            },
            compared: outcome.space,
            error: errors(outcome),
            torque: outcome.errors.torque.clone().map(TorqueEntry::from),
            residual_norm: NormEntry {
                before: norm(&outcome.remainder.before),
                after: norm(&outcome.remainder.after),
            },
            logs: logs(outcome),
            audit: outcome
                .given
                .audits
                .iter()
                .map(|audit| AuditEntry {
                    log: audit.log.clone(),
                    findings: audit.findings.clone(),
                })
                .collect(),
            tried: tried(outcome),
            stopped: outcome.effects.stopped,
            network: outcome
                .learned
                .as_ref()
                .map(|learned| learned.check.clone()),
            calibration: outcome.calibration.as_ref().map(CalibrationEntry::new),
            files: FilesEntry {
                model: MODEL,
                report: TEXT,
                checkpoint: outcome.learned.as_ref().map(|_| CHECKPOINT),
                plots: PLOTS.to_vec(),
            },
        }
    }
}

fn effect(finding: &Finding) -> EffectEntry {
    EffectEntry {
        name: finding.effect.effect.name.clone(),
        joint: finding.effect.joint,
        joints: both(&finding.effect),
        expression: finding.expression.clone(),
        parameters: finding.rows().iter().map(row).collect(),
        p_value: finding.p_value,
        error_reduction: finding.error_reduction.as_ref().ok().copied(),
        error_reduction_failure: (finding.error_reduction.as_ref().err()).map(ToString::to_string),
        not_established: finding.reason.clone(),
    }
}

/// The joints of an effect that couples two.
fn both(effect: &FittedEffect) -> Option<Vec<Joint>> {
    effect.effect.is_coupling().then(|| effect.joints())
}

fn row((of, own): &(Parameter, Option<&OwnValue>)) -> ParameterEntry {
    ParameterEntry {
        log: own.map(OwnValue::log_name),
        ..parameter(of)
    }
}

/// A parameter is identifiable where the logs give it an interval narrower than its magnitude.
fn parameter(parameter: &Parameter) -> ParameterEntry {
    let magnitude = parameter.value.abs().max(parameter.scale);
    let narrow = |[low, high]: [f64; 2]| high - low < 2.0 * magnitude;
    ParameterEntry {
        name: parameter.name.clone(),
        log: None,
        value: parameter.value,
        ci95: parameter.ci95,
        unit: parameter.unit.clone(),
        identifiable: parameter.ci95.is_some_and(narrow),
    }
}

fn contradicted(contradicted: &Contradicted) -> ContradictedEntry {
    ContradictedEntry {
        declared: contradicted.declared,
        fitted: parameter(&contradicted.fitted),
    }
}

fn effect_name(effect: &FittedEffect) -> EffectName {
    EffectName {
        name: effect.effect.name.clone(),
        joint: effect.joint,
        joints: both(effect),
        parameter: shifted(effect),
    }
}

fn alternative(alternative: &Alternative) -> AlternativeEntry {
    AlternativeEntry {
        effects: alternative.effects.iter().map(effect_name).collect(),
        reason: alternative.reason.clone(),
        experiment: alternative.experiment(),
        separation: alternative.separation.clone().ok(),
    }
}

fn shifted(effect: &FittedEffect) -> Option<String> {
    effect
        .shifted()
        .map(|_| effect.effect.parameters[0].name.clone())
}

fn left(outcome: &Outcome) -> UnexplainedEntry {
    let remainder = &outcome.remainder;
    UnexplainedEntry {
        left: remainder.unexplained.clone(),
        curves: (remainder.after.as_ref())
            .map_or_else(|_| Vec::new(), |force| force.curves.clone()),
        proposal: remainder.proposal.clone(),
    }
}

fn norm(force: &Result<ResidualForce, FitError>) -> Option<f64> {
    force.as_ref().ok().map(ResidualForce::norm)
}

fn ended(fit: &Fit) -> FitEntry {
    FitEntry {
        converged: fit.termination.has_converged(),
        termination: fit.termination.to_string(),
        steps: fit.steps,
        trace: fit.trace.clone(),
        condition: fit
            .condition()
            .map(|number| number.is_finite().then_some(number)),
    }
}

fn identifiability(outcome: &Outcome) -> IdentifiabilityEntry {
    let (verdict, bodies) = (&outcome.models.identifiability, &outcome.models.bodies);
    let name = |k: &usize| {
        outcome.models.before.model.all_parameters()[*k]
            .name
            .clone()
    };
    IdentifiabilityEntry {
        free: verdict.free,
        determined: verdict.determined,
        undetermined: verdict.undetermined.clone(),
        held: verdict.hold.iter().map(name).collect(),
        bodies: bodies.told.iter().map(combination).collect(),
        tellable: bodies.tellable,
    }
}

fn combination(one: &Combination) -> CombinationEntry {
    CombinationEntry {
        body: one.body + 1,
        sum: one.parts.clone(),
        declared: one.declared,
        value: one.value,
        ci95: one.ci95,
        unit: one.unit.clone(),
    }
}

fn errors(outcome: &Outcome) -> ErrorEntry {
    let joints = outcome.models.after.model.joints;
    let model = |assessment: &Assessment| model_error(summarise(&assessment.horizons, joints));
    let contender = |(name, assessment): &(String, Assessment)| ContenderEntry {
        name: name.clone(),
        error: model(assessment),
    };
    let errors = &outcome.errors;
    ErrorEntry {
        logs: "test",
        horizons_s: errors.before.horizons.iter().map(|h| h.horizon_s).collect(),
        unscored_s: outcome.given.unscored_s.clone(),
        declared: model(&errors.declared),
        before: model(&errors.before),
        after: model(&errors.after),
        zeroed: errors.zeroed.as_ref().map(model),
        hybrid: errors.hybrid.as_ref().map(model),
        against: errors.against.iter().map(contender).collect(),
        reduction_ci95: errors.reduction_ci95,
        integrator_step_s: errors.before.step_s.min(errors.after.step_s),
    }
}

fn model_error(summary: Summary) -> ModelError {
    let Summary {
        horizons_s: _,
        position_rmse,
        position_median,
        velocity_rmse,
        windows,
        diverged,
    } = summary;
    ModelError {
        position_rmse,
        position_median,
        velocity_rmse,
        windows,
        diverged,
    }
}

fn logs(outcome: &Outcome) -> LogsEntry {
    let entry = |(log, audit): (&Log, &Audit)| LogEntry {
        name: log.name(),
        rows: log.rows(),
        start_s: log.time.first().copied().unwrap_or(0.0),
        end_s: log.time.last().copied().unwrap_or(0.0),
        leave_out: log
            .leave_out
            .iter()
            .map(|span| [span.start_s, span.end_s])
            .collect(),
        jumps: audit.joints.iter().map(|joint| joint.q.spikes).collect(),
        dropped_rows: audit.dropped_rows,
    };
    let (of_train, of_test) = outcome.given.audits.split_at(outcome.given.train.len());
    LogsEntry {
        train: outcome
            .given
            .train
            .iter()
            .zip(of_train)
            .map(entry)
            .collect(),
        test: outcome.given.test.iter().zip(of_test).map(entry).collect(),
        split: outcome.given.split.clone(),
    }
}

fn tried(outcome: &Outcome) -> Vec<Vec<TriedEntry>> {
    let entry = |tried: &Tried| TriedEntry {
        effects: tried.effects.iter().map(effect_name).collect(),
        gain: tried.gain,
        chosen: tried.chosen,
    };
    let round = |round: &Round| round.tried.iter().map(entry).collect();
    outcome.effects.rounds.iter().map(round).collect()
}

impl From<TorqueErrors> for TorqueEntry {
    fn from(errors: TorqueErrors) -> Self {
        Self {
            as_declared: errors.declared,
            before: errors.before,
            after: errors.after,
            reduction_ci95: errors.reduction_ci95,
        }
    }
}

fn joint_names(model: &Model) -> Vec<String> {
    if model.joint_names.is_empty() {
        Joint::all(model.joints)
            .map(|joint| joint.name("q"))
            .collect()
    } else {
        model.joint_names.clone()
    }
}
