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
    pub logs: Logs,
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

/// What a request learns from and is judged by.
#[derive(Debug, Clone)]
pub enum Logs {
    /// Some are set apart for the test as `settings.split` says when the loop is closed.
    Together(Vec<Log>),
    /// They are divided already.
    Divided(Split),
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
        Self::on(model, library, Logs::Divided(split))
    }

    /// The same on logs of which some are set apart for the test, by the settings that the request has when the loop is
    /// closed.
    pub fn of(model: &'a Model, library: &'a Library, logs: Vec<Log>) -> Self {
        Self::on(model, library, Logs::Together(logs))
    }

    fn on(model: &'a Model, library: &'a Library, logs: Logs) -> Self {
        Self {
            model,
            library,
            logs,
            against: Vec::new(),
            settings: Settings::default(),
            space: None,
            budget: None,
            learner: None,
        }
    }

    /// Divide the logs, as the settings say where the user has not done so.
    pub(super) fn divided(&mut self) -> Split {
        match std::mem::replace(&mut self.logs, Logs::Together(Vec::new())) {
            Logs::Together(logs) => Split::of(logs, &self.settings.split),
            Logs::Divided(split) => split,
        }
    }

    /// Keep those of the horizons of which the test logs hold a window, and return the others.
    ///
    /// # Errors
    /// Test logs without a window of any of them.
    pub(super) fn score_on(&mut self, test: &[Log]) -> Result<Vec<f64>, StudyError> {
        let horizons_s = self.settings.score.horizons_s.drain(..);
        let (scored_s, unscored_s): (Vec<_>, Vec<_>) =
            horizons_s.partition(|horizon_s| window_count(test, *horizon_s) > 0);
        if scored_s.is_empty() {
            return Err(StudyError::NoTest {
                shortest_s: unscored_s.into_iter().fold(f64::INFINITY, f64::min),
                found: self.serious_in(test),
            });
        }
        self.settings.score.horizons_s = scored_s;
        Ok(unscored_s)
    }

    /// The first serious finding about a test log, as the end of a sentence; empty without one.
    fn serious_in(&self, test: &[Log]) -> String {
        let audits = audit_together(test, &self.model.columns);
        let mut found = audits.iter().flat_map(|audit| {
            let told = |finding: &Finding| format!("; {}: {finding}", audit.log);
            audit.serious().map(told).next()
        });
        found.next().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Channels;

    fn log(number: u32) -> Log {
        let time: Vec<f64> = (0..100).map(|row| 0.1 * f64::from(row)).collect();
        let q = vec![time.clone()];
        let channels = Channels {
            time,
            q,
            ..Channels::default()
        };
        channels.log(&format!("run {number}")).unwrap()
    }

    #[test]
    fn settings_that_are_changed_later_divide_the_logs() {
        let library = Library::empty();
        let model = library.model("pendulum").unwrap();
        let mut request = Request::of(&model, &library, (1..=4).map(log).collect());
        request.settings.split.test_share = 0.5;
        let split = request.divided();
        assert_eq!((split.train.len(), split.test.len()), (2, 2));
    }

    #[test]
    fn logs_that_the_user_divides_stay_divided() {
        let library = Library::empty();
        let model = library.model("pendulum").unwrap();
        let split = Split::given((1..=3).map(log).collect(), vec![log(4)]);
        let mut request = Request::new(&model, &library, split);
        request.settings.split.test_share = 0.5;
        assert_eq!(request.divided().test, [log(4)]);
    }
}
