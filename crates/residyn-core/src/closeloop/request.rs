use super::error_model::ErrorModel;
use super::learn::ResidualLearner;
use super::settings::Settings;
use super::split::Split;
use crate::data::{Log, LogError};
use crate::identify::{LevenbergMarquardt, Solver};
use crate::model::{Library, Model};

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
    /// Horizons of the errors in s, of which the middle one is the length of the windows that models are fitted over;
    /// if not given, those of the settings or, for the free motion of a joint, several swings.
    pub horizons_s: Option<Vec<f64>>,
    /// Which errors to compare; if not given, those that say more about these logs.
    pub error_model: Option<ErrorModel>,
    /// Finds the minimum of each fit.
    pub solver: &'a dyn Solver,
    /// Trains the residual network; without it there is none.
    pub learner: Option<&'a dyn ResidualLearner>,
}

/// The logs that a request learns from and is judged by.
#[derive(Debug, Clone)]
pub enum Logs {
    /// Some are set apart for the test, as `settings.split` says, when the loop is closed.
    Together(Vec<Log>),
    /// They are divided already.
    Divided(Split),
}

/// A model that is scored as it is, next to the fitted models.
#[derive(Debug, Clone)]
pub struct Reference {
    /// The user's name for it.
    pub name: String,
    /// With the same joints as the declared model.
    pub model: Model,
}

impl<'a> Request<'a> {
    /// A request with the default settings and solver, without a residual network and without reference models.
    pub fn new(model: &'a Model, library: &'a Library, split: Split) -> Self {
        Self::on(model, library, Logs::Divided(split))
    }

    /// The same with undivided logs: some are set apart for the test by the settings that the request has when the loop
    /// is closed.
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
            horizons_s: None,
            error_model: None,
            solver: &LevenbergMarquardt::USUAL,
            learner: None,
        }
    }

    /// Whether all logs have the further measured columns that the models read, for logs that were not read with the
    /// declared model's columns.
    ///
    /// # Errors
    /// The first column that one lacks.
    pub fn check_measured(&self) -> Result<(), LogError> {
        let logs: Vec<&Log> = match &self.logs {
            Logs::Together(logs) => logs.iter().collect(),
            Logs::Divided(split) => split.train.iter().chain(&split.test).collect(),
        };
        let references = self.against.iter().map(|reference| &reference.model);
        for model in [self.model].into_iter().chain(references) {
            for log in &logs {
                log.check_measured(model.measured_names())?;
            }
        }
        Ok(())
    }

    /// Divide the logs as the settings say, if the user has not done so.
    pub(super) fn divided(&mut self) -> Split {
        match std::mem::replace(&mut self.logs, Logs::Together(Vec::new())) {
            Logs::Together(logs) => Split::of(logs, &self.settings.split),
            Logs::Divided(split) => split,
        }
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
