//! `report.json`: the outcome with fixed names, for other programs.

use super::by_log::{by_log, ranges};
use super::calibration::CalibrationEntry;
use super::headline::{headline, place};
use super::overview::{declared, differences, found, of_joints};
use super::plot_data::PlotData;
use super::schema::{
    AlternativeEntry, AuditEntry, CombinationEntry, ContenderEntry, ContradictedEntry, EffectEntry,
    EffectName, ErrorEntry, FilesEntry, FitEntry, FitsEntry, IdentifiabilityEntry, LogEntry,
    LogsEntry, ModelError, NormEntry, ParameterEntry, RefittedEntry, Report, SCHEMA, TriedEntry,
    UnexplainedEntry,
};
use residyn_core::closeloop::{
    Alternative, Contradicted, Finding, Outcome, ResidualForce, Round, Tried,
};
use residyn_core::data::{Audit, Joint, Log};
use residyn_core::identify::{Combination, Fit, FitError};
use residyn_core::model::{FittedEffect, Model, Origin, Parameter, PerLogValue};
use residyn_core::sim::metric::{Assessment, Summary, summarise};

/// Names of the files in the folder of a report.
pub(super) const MODEL: &str = "model.toml";
pub(super) const RANGES: &str = "ranges.json";
pub(super) const REPORT: &str = "report.json";
pub(super) const TEXT: &str = "report.md";
pub(super) const PAGE: &str = "report.html";
pub(super) const CHECKPOINT: &str = "checkpoint";
pub(super) const PLOTS: [&str; 3] = ["predictions.svg", "residual.svg", "errors.svg"];

impl Report {
    /// The outcome of a run of this origin.
    pub fn new(outcome: &Outcome, origin: &Origin) -> Self {
        let model = outcome.models.after.model.absorbed();
        let by_log = by_log(outcome);
        let like = model.like_joints();
        let declared = declared(outcome, &model);
        let of_joints = of_joints(&declared);
        let all: Vec<_> = found(outcome).into_iter().chain(declared).collect();
        Self {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            seed: origin.seed,
            configuration: origin.config.clone(),
            call: origin.call.clone(),
            settings: outcome.given.settings.clone(),
            system: model.name.clone(),
            joints: model.joints,
            joint_names: joint_names(&model),
            differences: differences(&like, &all),
            like_joints: like,
            prismatic: outcome.given.prismatic.clone(),
            driven_by: model.driven_by().key().to_owned(),
            verdict: outcome.verdict,
            headline: headline(outcome),
            reason: outcome.reason.clone(),
            effects: effects(outcome, &outcome.effects.findings),
            alternatives: (outcome.effects.alternatives.iter())
                .map(|rival| alternative(outcome, rival))
                .collect(),
            supported: effects(outcome, &outcome.effects.supported),
            unexplained: left(outcome),
            equations: model.latex(),
            parameters: refitted(outcome, &model),
            of_joints,
            ranges: ranges(outcome, &by_log),
            by_log,
            contradicted: outcome
                .models
                .contradicted
                .iter()
                .map(contradicted)
                .collect(),
            identifiability: identifiability(outcome),
            fits: fits(outcome),
            smoothing_velocities: outcome.models.after.model.smoothing_velocities(),
            compared: outcome.error_model,
            error: errors(outcome),
            torque: outcome.errors.torque.clone(),
            residual_norm: norms(&outcome.diagnostics.before, &outcome.diagnostics.after),
            logs: logs(outcome),
            audit: audits(outcome),
            tried: tried(outcome),
            candidates: (outcome.effects.rounds.iter())
                .map(|round| round.candidates)
                .collect(),
            stopped: outcome.effects.stopped,
            network: outcome
                .learned
                .as_ref()
                .map(|learned| learned.check.clone()),
            calibration: outcome.calibration.as_ref().map(CalibrationEntry::new),
            plots: PlotData::of(outcome),
            files: FilesEntry {
                model: MODEL.to_owned(),
                report: TEXT.to_owned(),
                page: PAGE.to_owned(),
                checkpoint: outcome.network().map(|_| CHECKPOINT.to_owned()),
                plots: PLOTS.map(str::to_owned).to_vec(),
            },
        }
    }
}

fn audits(outcome: &Outcome) -> Vec<AuditEntry> {
    let audits = outcome.given.audits.iter().map(|audit| AuditEntry {
        log: audit.log.clone(),
        findings: audit.findings.clone(),
        repeats: audit.repeats.clone(),
    });
    audits.collect()
}

fn fits(outcome: &Outcome) -> FitsEntry {
    let moved_to = outcome.models.moved_to.iter();
    FitsEntry {
        moved_to: moved_to
            .map(|parameter| (parameter.name.clone(), parameter.value))
            .collect(),
        before: ended(&outcome.models.before.fit),
        after: ended(&outcome.models.after.fit),
    }
}

fn effects(outcome: &Outcome, findings: &[Finding]) -> Vec<EffectEntry> {
    let each = findings.iter();
    each.map(|finding| effect(outcome, finding)).collect()
}

fn effect(outcome: &Outcome, finding: &Finding) -> EffectEntry {
    let names: Vec<String> = (finding.parameters.iter())
        .map(|parameter| parameter.name.clone())
        .collect();
    let driven_by = outcome.models.after.model.driven_by();
    EffectEntry {
        name: finding.effect.effect.name.clone(),
        joint: finding.effect.joint,
        joints: both(&finding.effect),
        title: finding.effect.title(),
        place: place(outcome, &finding.effect),
        expression: finding.expression.clone(),
        latex: (finding.effect.shifted().is_none())
            .then(|| finding.effect.latex(&names, driven_by)),
        enters: finding.effect.enters(str::to_owned),
        parameters: finding.rows().iter().map(row).collect(),
        p_value: finding.p_value,
        error_reduction: finding.error_reduction.as_ref().ok().copied(),
        error_reduction_failure: (finding.error_reduction.as_ref().err()).map(ToString::to_string),
        motion_reduction: finding.motion_reduction,
        not_established: finding.reason.clone(),
    }
}

/// The joints of an effect that couples two.
fn both(effect: &FittedEffect) -> Option<Vec<Joint>> {
    effect.effect.is_coupling().then(|| effect.joints())
}

fn row((of, own): &(Parameter, Option<&PerLogValue>)) -> ParameterEntry {
    ParameterEntry {
        log: own.map(PerLogValue::log_name),
        ..parameter(of)
    }
}

/// A parameter is identifiable if the logs give it an interval narrower than its magnitude.
pub(super) fn parameter(parameter: &Parameter) -> ParameterEntry {
    let magnitude = parameter.value.abs().max(parameter.scale);
    let narrow = |[low, high]: [f64; 2]| high - low < 2.0 * magnitude;
    ParameterEntry {
        name: parameter.name.clone(),
        log: None,
        value: parameter.value,
        ci95: parameter.ci95,
        unit: parameter.unit.clone(),
        identifiable: parameter.ci95.is_some_and(narrow),
        at_bound: !parameter.fixed && parameter.bounds.contains(&parameter.value),
    }
}

fn contradicted(contradicted: &Contradicted) -> ContradictedEntry {
    ContradictedEntry {
        declared: contradicted.declared,
        comparison: contradicted.comparison(),
        fitted: parameter(&contradicted.fitted),
    }
}

fn effect_name(effect: &FittedEffect) -> EffectName {
    EffectName {
        name: effect.effect.name.clone(),
        joint: effect.joint,
        joints: both(effect),
        label: effect.label(),
        parameter: shifted(effect),
    }
}

fn alternative(outcome: &Outcome, alternative: &Alternative) -> AlternativeEntry {
    AlternativeEntry {
        effects: alternative.effects.iter().map(effect_name).collect(),
        title: alternative.effect.title(),
        place: place(outcome, &alternative.effect),
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
    let diagnostics = &outcome.diagnostics;
    UnexplainedEntry {
        left: diagnostics.unexplained.clone(),
        curves: (diagnostics.after.as_ref())
            .map_or_else(|_| Vec::new(), |force| force.curves.clone()),
        proposal: diagnostics.proposal.clone(),
    }
}

fn norms(
    before: &Result<ResidualForce, FitError>,
    after: &Result<ResidualForce, FitError>,
) -> NormEntry {
    let norm =
        |force: &Result<ResidualForce, FitError>| force.as_ref().ok().map(ResidualForce::norm);
    let failure = before.as_ref().err().or(after.as_ref().err());
    NormEntry {
        before: norm(before),
        after: norm(after),
        failure: failure.map(ToString::to_string),
    }
}

/// The parameters of the declared equations, or their values in single logs; those of `model` include the shifts.
fn refitted(outcome: &Outcome, model: &Model) -> Vec<RefittedEntry> {
    let before = &outcome.models.before.model.parameters;
    let declared = &outcome.given.declared;
    let entry = |(k, ((after, before), declared)): (usize, ((&Parameter, &Parameter), &f64))| {
        let entry = |fitted| RefittedEntry {
            fitted,
            declared: *declared,
            before: before.value,
        };
        let own: Vec<&PerLogValue> = (model.own.iter())
            .filter(|own| own.parameter == k)
            .collect();
        let in_log = |own: &PerLogValue| {
            let parameter = Parameter {
                value: own.value,
                ci95: own.ci95,
                ..after.clone()
            };
            entry(row(&(parameter, Some(own))))
        };
        match own.is_empty() {
            true => vec![entry(parameter(after))],
            false => own.into_iter().map(in_log).collect(),
        }
    };
    let all = model.parameters.iter().zip(before).zip(declared);
    all.enumerate().flat_map(entry).collect()
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
        bodies: bodies.identifiable.iter().map(combination).collect(),
        identifiable_at_most: bodies.identifiable_at_most,
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
        logs: "test".to_owned(),
        fitted_logs: outcome.given.fitted_tests.clone(),
        horizons_s: errors.before.horizons.iter().map(|h| h.horizon_s).collect(),
        unscored_s: outcome.given.unscored_s.clone(),
        declared: model(&errors.declared),
        before: model(&errors.before),
        with_friction: errors.with_friction.as_ref().map(model),
        after: model(&errors.after),
        zeroed: errors.zeroed.as_ref().map(model),
        hybrid: errors.hybrid.as_ref().map(model),
        against: errors.against.iter().map(contender).collect(),
        reduction_ci95: errors.reduction_ci95,
        noise_floor: errors.noise_floor,
        by_log: errors.by_log.clone(),
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

fn joint_names(model: &Model) -> Vec<String> {
    if model.joint_names.is_empty() {
        Joint::all(model.joints)
            .map(|joint| joint.name("q"))
            .collect()
    } else {
        model.joint_names.clone()
    }
}
