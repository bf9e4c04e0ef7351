use super::learn::ResidualLearner;
use super::settings::Settings;
use super::space::Space;
use super::split::Split;
use crate::data::Log;
use crate::model::{Library, Model};

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
            learner: None,
        }
    }

    /// The same on logs of which some are set apart for the test.
    pub fn of(model: &'a Model, library: &'a Library, logs: Vec<Log>) -> Self {
        let split = Split::of(logs, &Settings::default().split);
        Self::new(model, library, split)
    }
}
