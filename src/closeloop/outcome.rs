use super::by_log::OfLog;
use super::calibrate::Calibration;
use super::discriminate::Alternative;
use super::fitted::Fitted;
use super::learn::{Learned, LearnedResidual};
use super::remainder::{Proposal, ResidualForce, Unexplained};
use super::score::{Contradicted, Errors, Finding};
use super::select::Round;
use super::settings::Settings;
use super::space::Space;
use super::split::SplitMethod;
use super::stage::Stage;
use super::study::Study;
use super::verdict::Verdict;
use crate::data::{Audit, Log};
use crate::identify::{BodiesTold, FitError, Identifiability, Uncertainty};
use crate::model::{Model, Parameter};

/// Everything that closing the loop found out.
#[non_exhaustive]
pub struct Outcome {
    /// Which errors were compared.
    pub space: Space,
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    pub given: Given,
    pub models: Models,
    pub effects: Effects,
    pub remainder: Remainder,
    pub errors: Errors,
    /// The residual network and whether it helps, where the logs suffice to train one.
    pub learned: Option<Learned>,
    /// The chosen model fitted to each training log alone; empty for a single log and for very many.
    pub by_log: Vec<OfLog>,
    /// What the training logs could show, where that was asked for: see [`Calibrator`](super::Calibrator).
    pub calibration: Option<Calibration>,
    /// How long each stage took in s.
    pub seconds: Vec<(Stage, f64)>,
}

/// What was studied.
#[non_exhaustive]
pub struct Given {
    pub train: Vec<Log>,
    /// The training logs as they were fitted: with readings that jump masked and dropped rows put in or left out.
    pub studied: Vec<Log>,
    pub test: Vec<Log>,
    /// Names of the test logs that are training logs once more: they were fitted, and test nothing.
    pub fitted_tests: Vec<String>,
    pub split: SplitMethod,
    /// Of the training logs, then of the test logs.
    pub audits: Vec<Audit>,
    pub settings: Settings,
    /// Horizons in s of which the test logs hold no window.
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
    /// The free declared parameters at the values that their fit began with, where the model diverges with those in its file;
    /// else empty.
    pub moved_to: Vec<Parameter>,
    /// What the logs determine of the declared parameters.
    pub identifiability: Identifiability,
    /// What they tell of the bodies of a chain, where torques were compared.
    pub bodies: BodiesTold,
    /// Values in the model file that the fit of `after` contradicts.
    pub contradicted: Vec<Contradicted>,
}

/// The effects that were found, and what else was considered.
#[non_exhaustive]
pub struct Effects {
    /// Those that are established.
    pub findings: Vec<Finding>,
    /// Those that are not, and yet lower the loss on stretches left out of the fit: the model has them, but their names
    /// are not to be relied on.
    pub supported: Vec<Finding>,
    /// What the logs do not tell from the findings.
    pub alternatives: Vec<Alternative>,
    /// What was tried.
    pub rounds: Vec<Round>,
    /// Whether the search was stopped because its time was spent.
    pub stopped: bool,
}

/// What the effects leave unexplained.
#[non_exhaustive]
pub struct Remainder {
    pub unexplained: Unexplained,
    /// A formula for it, where something that matters is left.
    pub proposal: Option<Proposal>,
    /// Residual generalised force of the declared model, fitted, or why there is none.
    pub before: Result<ResidualForce, FitError>,
    /// The same with the effects that were found.
    pub after: Result<ResidualForce, FitError>,
}

impl Outcome {
    /// The residual network, where there is one.
    pub fn network(&self) -> Option<&dyn LearnedResidual> {
        self.learned.as_ref()?.network.as_deref()
    }

    /// The training logs as they were studied; `declared` is the model they were studied for.
    pub fn study<'a>(&'a self, declared: &'a Model) -> Study<'a> {
        let Given {
            studied,
            audits,
            settings,
            ..
        } = &self.given;
        let audits = audits[..studied.len()].to_vec();
        Study {
            identifiability: self.models.identifiability.clone(),
            ..Study::audited(declared, self.space, studied, audits, settings)
        }
    }
}
