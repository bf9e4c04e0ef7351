use std::sync::Arc;

use super::by_log::OfLog;
use super::calibrate::Calibration;
use super::diagnostics::{Proposal, ResidualForce, Unexplained, proposal};
use super::discriminate::Alternative;
use super::error_model::ErrorModel;
use super::establish::Chosen;
use super::fitted::Fitted;
use super::judge::Found;
use super::learn::{Learned, LearnedResidual};
use super::notes::Noted;
use super::prepare::Prepared;
use super::problem::Problem;
use super::refine::Refined;
use super::score::{Contradicted, Errors, Finding, Predictions, contradicted};
use super::select::Round;
use super::settings::Settings;
use super::split::SplitMethod;
use super::stage::Stage;
use super::verdict::Verdict;
use crate::data::{Audit, Log};
use crate::identify::{FitError, Identifiability, IdentifiableBodies, Uncertainty};
use crate::model::{Library, Model, Parameter, Status};

/// Everything that closing the loop found out.
#[non_exhaustive]
pub struct Outcome {
    /// Which errors were compared.
    pub error_model: ErrorModel,
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    pub given: Given,
    pub models: Models,
    pub effects: Effects,
    pub diagnostics: Diagnostics,
    pub errors: Errors,
    /// What the models predict for the test logs.
    pub predictions: Predictions,
    /// The residual network and whether it helps, if the logs suffice to train one.
    pub learned: Option<Learned>,
    /// The chosen model fitted to each training log alone; empty for a single log and for very many.
    pub by_log: Vec<OfLog>,
    /// What the training logs could show, if that was requested: see [`Calibrator`](super::Calibrator).
    pub calibration: Option<Calibration>,
    /// How long each stage took in s, to be filled in by the watcher (see [`StageTimes`](super::StageTimes)); empty at
    /// first.
    pub seconds: Vec<(Stage, f64)>,
}

/// What was studied.
#[non_exhaustive]
pub struct Given {
    pub train: Arc<[Log]>,
    /// The training logs as they were fitted: with jumping readings masked and dropped rows filled in or left out.
    pub studied: Arc<[Log]>,
    pub test: Arc<[Log]>,
    /// Names of the test logs that repeat training logs: they were fitted, and test nothing.
    pub fitted_tests: Vec<String>,
    pub split: SplitMethod,
    /// Of the training logs, then of the test logs.
    pub audits: Vec<Audit>,
    pub settings: Settings,
    /// Horizons in s for which the test logs hold no window.
    pub unscored_s: Vec<f64>,
    /// For each joint whether it slides rather than turns.
    pub prismatic: Vec<bool>,
    /// Values of the declared parameters in the model file.
    pub declared: Vec<f64>,
}

/// The fitted models.
#[non_exhaustive]
pub struct Models {
    /// The declared model, fitted.
    pub before: Fitted,
    /// With the effects that were found, and with 95 % intervals.
    pub after: Fitted,
    /// How well the fit of `after` determines its values.
    pub uncertainty: Uncertainty,
    /// The free declared parameters at the starting values of their fit, if the model diverges at the values in its
    /// file; else empty.
    pub moved_to: Vec<Parameter>,
    /// What the logs determine of the declared parameters.
    pub identifiability: Identifiability,
    /// What the logs determine of a chain's bodies, if torques were compared.
    pub bodies: IdentifiableBodies,
    /// Values in the model file that the fit of `after` contradicts.
    pub contradicted: Vec<Contradicted>,
}

/// The effects that were found, and what else was considered.
#[non_exhaustive]
pub struct Effects {
    /// Those that are established.
    pub findings: Vec<Finding>,
    /// Effects that are not established, yet lower the loss on blocks left out of the fit: the model has them, but
    /// their names cannot be relied on.
    pub supported: Vec<Finding>,
    /// Explanations that the logs do not distinguish from the findings.
    pub alternatives: Vec<Alternative>,
    /// What was tried.
    pub rounds: Vec<Round>,
    /// Whether the search was stopped because its time ran out.
    pub stopped: bool,
}

/// What the effects leave unexplained.
#[non_exhaustive]
pub struct Diagnostics {
    pub unexplained: Unexplained,
    /// A formula for it, if something that matters is left.
    pub proposal: Option<Proposal>,
    /// Residual generalised force of the fitted declared model, or why there is none.
    pub before: Result<ResidualForce, FitError>,
    /// The same with the effects that were found.
    pub after: Result<ResidualForce, FitError>,
}

impl Outcome {
    /// The residual network, if there is one.
    pub fn network(&self) -> Option<&dyn LearnedResidual> {
        self.learned.as_ref()?.network.as_deref()
    }

    /// The problem that was studied, rebuilt for the model and the library that it was studied with.
    pub fn problem<'a>(&'a self, declared: &'a Model, library: &'a Library) -> Problem<'a> {
        let given = &self.given;
        let audits = given.audits[..given.studied.len()].to_vec();
        let logs = (&*given.studied, audits);
        Problem::audited(declared, library, self.error_model, logs, &given.settings)
            .knowing(self.models.identifiability.clone())
    }
}

impl Given {
    pub(super) fn of(prepared: &Prepared<'_>, noted: Noted) -> Self {
        let model = &prepared.model;
        Self {
            train: Arc::clone(&prepared.train.logs),
            studied: Arc::clone(&prepared.train.for_fits),
            test: Arc::clone(&prepared.test.logs),
            fitted_tests: noted.fitted_tests,
            split: prepared.split.clone(),
            audits: noted.audits,
            settings: prepared.settings.clone(),
            unscored_s: prepared.unscored_s.clone(),
            prismatic: model.prismatic.clone(),
            declared: model.parameters.iter().map(|p| p.value).collect(),
        }
    }
}

impl Models {
    pub(super) fn of(problem: &Problem<'_>, refined: Refined<'_>) -> Self {
        let fitted = refined.after.model.absorbed().all_parameters();
        Self {
            contradicted: contradicted(&problem.declared.all_parameters(), &fitted),
            before: refined.before,
            after: refined.after,
            bodies: refined.bodies,
            uncertainty: refined.uncertainty,
            moved_to: problem.moved_to.clone(),
            identifiability: refined.identifiability,
        }
    }
}

impl Effects {
    pub(super) fn of(
        mut findings: Vec<Finding>,
        alternatives: Vec<Alternative>,
        chosen: Chosen,
    ) -> Self {
        findings.sort_by_key(|finding| finding.effect.joint.index());
        let (findings, supported) =
            (findings.into_iter()).partition(|finding| finding.status == Status::Established);
        Self {
            findings,
            supported,
            alternatives,
            rounds: chosen.rounds,
            stopped: chosen.stopped,
        }
    }
}

impl Diagnostics {
    pub(super) fn of(found: &Found<'_>, refined: &Refined<'_>) -> Self {
        let problem = &found.problem;
        let (before, after) = rayon::join(
            || ResidualForce::of(problem, &found.before),
            || ResidualForce::of(problem, &found.chosen.after),
        );
        Self {
            proposal: proposal(problem, &refined.after, &found.unexplained),
            unexplained: found.unexplained.clone(),
            before,
            after,
        }
    }
}
