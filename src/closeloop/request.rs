use std::time::Duration;

use super::error::StudyError;
use super::learn::ResidualLearner;
use super::settings::Settings;
use super::space::Space;
use super::split::Split;
use crate::data::{Finding, Log, audit_together};
use crate::model::{Library, Model};
use crate::sim::metric::window_count;

/// The inputs of closing the loop.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Request<'a> {
    /// The declared model.
    pub model: &'a Model,
    /// The effects that it may lack.
    pub library: &'a Library,
    pub split: Split,
    /// Models to score as they are on the same test logs.
    pub against: Vec<Reference>,
    pub settings: Settings,
    /// Which errors to compare; without it, those that say more about these logs.
    pub space: Option<Space>,
    /// Time after which the search for effects stops where it stands; without one it goes on to its end.
    pub budget: Option<Duration>,
    /// Trains the residual network; without it there is none.
    pub learner: Option<&'a dyn ResidualLearner>,
}

/// A model that is scored as it is, beside those that are fitted.
#[derive(Debug, Clone)]
pub struct Reference {
    /// As the user calls it.
    pub name: String,
    /// With the same joints as the declared model.
    pub model: Model,
}

impl<'a> Request<'a> {
    /// A request with the default settings, without a residual network and without reference models.
    pub fn new(model: &'a Model, library: &'a Library, split: Split) -> Self {
        Self {
            model,
            library,
            split,
            against: Vec::new(),
            settings: Settings::default(),
            space: None,
            budget: None,
            learner: None,
        }
    }

    /// The same on logs of which some are set apart for the test.
    pub fn of(model: &'a Model, library: &'a Library, logs: Vec<Log>) -> Self {
        let split = Split::of(logs, &Settings::default().split);
        Self::new(model, library, split)
    }

    /// The same with those of the horizons of which the test logs hold a window, and the others.
    ///
    /// # Errors
    /// Test logs without a window of any of them.
    pub(super) fn scorable(mut self) -> Result<(Self, Vec<f64>), StudyError> {
        let horizons_s = self.settings.score.horizons_s.drain(..);
        let (scored_s, unscored_s): (Vec<_>, Vec<_>) =
            horizons_s.partition(|horizon_s| window_count(&self.split.test, *horizon_s) > 0);
        if scored_s.is_empty() {
            return Err(StudyError::NoTest {
                shortest_s: unscored_s.into_iter().fold(f64::INFINITY, f64::min),
                found: self.serious_in_test(),
            });
        }
        self.settings.score.horizons_s = scored_s;
        Ok((self, unscored_s))
    }

    /// The first serious finding about a test log, as the end of a sentence; empty without one.
    fn serious_in_test(&self) -> String {
        let audits = audit_together(&self.split.test, &self.model.columns);
        let mut found = audits.iter().flat_map(|audit| {
            let told = |finding: &Finding| format!("; {}: {finding}", audit.log);
            audit.serious().map(told).next()
        });
        found.next().unwrap_or_default()
    }
}
