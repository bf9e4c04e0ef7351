//! Stages 1 and 2: the logs in order, audited, and in the form that fits use.

use std::borrow::Cow;
use std::sync::Arc;

use super::error::StudyError;
use super::error_model::ErrorModel;
use super::learn::ResidualLearner;
use super::problem::Problem;
use super::request::{Reference, Request};
use super::settings::Settings;
use super::split::SplitMethod;
use super::stage::{Stage, Watch};
use crate::data::{Audit, Finding, Log, Severity, audit_together};
use crate::identify::Solver;
use crate::limits::FITTED_PARAMETERS;
use crate::model::{Library, Model};
use crate::sim::metric::window_count;

/// The request, with its logs made ready.
pub struct Prepared<'a> {
    /// The declared model; it says what the torques of the logs are.
    pub model: Cow<'a, Model>,
    /// The effects that it may lack.
    pub library: &'a Library,
    /// Models to score as they are.
    pub against: Vec<Reference>,
    /// With the horizons that a test log is long enough for.
    pub settings: Settings,
    /// Horizons in s for which the test logs hold no window.
    pub unscored_s: Vec<f64>,
    /// Which errors to compare; if not given, those that say more about these logs.
    pub error_model: Option<ErrorModel>,
    /// Finds the minimum of each fit.
    pub solver: &'a dyn Solver,
    /// Trains the residual network; without it there is none.
    pub learner: Option<&'a dyn ResidualLearner>,
    pub split: SplitMethod,
    pub train: ReadyLogs,
    pub test: ReadyLogs,
}

/// Some logs, in the order of their names.
pub struct ReadyLogs {
    /// As they were read; only a part of long ones.
    pub logs: Arc<[Log]>,
    /// With jumping readings masked and dropped rows filled in or left out.
    pub for_fits: Arc<[Log]>,
    /// One per log.
    pub audits: Vec<Audit>,
}

/// Put the logs in order, audit each once, and make them ready for fits.
pub fn prepare<'a>(mut request: Request<'a>, watch: &dyn Watch) -> Prepared<'a> {
    watch.see(Stage::Audit.into());
    let split = request.divided();
    let model = request.model;
    let mut settings = match request.horizons_s {
        Some(horizons_s) => request.settings.with_horizons(horizons_s),
        None => request.settings.over_swings(model, &split.train),
    };
    let horizons_s = settings.score.horizons_s.drain(..);
    let (scored_s, unscored_s) =
        horizons_s.partition(|horizon_s| window_count(&split.test, *horizon_s) > 0);
    settings.score.horizons_s = scored_s;
    let (split, window_s) = (split.in_order(), settings.fit.window_s);
    let ready = |logs: Vec<Log>| {
        let mut audits = audit_together(&logs, &model.columns);
        let logs = shortened(logs, &mut audits);
        let for_fits = logs.iter().map(|log| log.for_fits(window_s));
        ReadyLogs {
            for_fits: for_fits.collect(),
            logs: logs.into(),
            audits,
        }
    };
    Prepared {
        train: ready(split.train),
        test: ready(split.test),
        split: split.method,
        model: Cow::Borrowed(model),
        library: request.library,
        against: request.against,
        unscored_s,
        error_model: request.error_model,
        solver: request.solver,
        // Networks read states and torques alone.
        learner: (request.learner).filter(|_| model.measured.is_empty()),
        settings,
    }
    .with_known_torques()
}

impl Prepared<'_> {
    /// # Errors
    /// Test logs too short for every horizon, torques that are to be compared but cannot be, or more free parameters
    /// than can be fitted.
    pub(super) fn check(&self) -> Result<(), StudyError> {
        let free = self.model.free_parameters();
        if free > FITTED_PARAMETERS {
            let model = self.model.name.clone();
            return Err(StudyError::TooManyParameters { model, free });
        }
        if self.settings.score.horizons_s.is_empty() {
            let horizons_s = self.unscored_s.iter().copied();
            return Err(StudyError::NoTest {
                shortest_s: horizons_s.fold(f64::INFINITY, f64::min),
                found: self.serious_in_test(),
            });
        }
        if self.error_model == Some(ErrorModel::InverseDynamics)
            && self.model.torque_balance().is_none()
        {
            return Err(StudyError::NoTorques {
                model: self.model.name.clone(),
            });
        }
        Ok(())
    }

    /// The first serious finding about a test log, as the end of a sentence; empty without one.
    fn serious_in_test(&self) -> String {
        let mut found = self.test.audits.iter().flat_map(|audit| {
            let message = |finding: &Finding| format!("; {}: {finding}", audit.log);
            audit.serious().map(message).next()
        });
        found.next().unwrap_or_default()
    }

    /// The problem, in terms of these errors.
    pub(super) fn problem(&self, error_model: ErrorModel) -> Problem<'_> {
        let logs = (&*self.train.for_fits, self.train.audits.clone());
        Problem {
            solver: self.solver,
            ..Problem::audited(&self.model, self.library, error_model, logs, &self.settings)
        }
    }

    /// The audits of all logs, the test logs last.
    pub fn audits(&self) -> impl Iterator<Item = &Audit> {
        self.train.audits.iter().chain(&self.test.audits)
    }
}

/// The part of each log that fits read; the audits report the logs that were shortened.
fn shortened(logs: Vec<Log>, audits: &mut [Audit]) -> Vec<Log> {
    let shorten = |(log, audit): (Log, &mut Audit)| {
        let is_long = log.is_long();
        let log = log.shortened();
        if let Some(note) = log.notes.last().filter(|_| is_long) {
            audit.add(Finding::new(Severity::Warning, note.clone()));
        }
        log
    };
    logs.into_iter().zip(audits).map(shorten).collect()
}
