use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::limits::{SettingsError, whole};
use super::method::Search;
use super::{Cem, Icem, Mppi};
use residyn_core::limits::{CANDIDATES, HORIZON, ITERATIONS};

/// How a planner searches. In a file this is one table:
///
/// ```toml
/// method = "cem"
/// population = 300
/// elite = 20
/// iterations = 10
/// horizon = 80
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Candidates evaluated in each iteration.
    pub population: usize,
    pub iterations: usize,
    /// Steps of a plan.
    pub horizon: usize,
    #[serde(flatten)]
    pub method: Method,
}

/// How much a search evaluates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Candidates evaluated in each iteration.
    pub population: usize,
    pub iterations: usize,
    /// Steps of a plan.
    pub horizon: usize,
}

/// How the next candidates follow from the last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "snake_case")]
pub enum Method {
    Cem(Cem),
    Icem(Icem),
    Mppi(Mppi),
}

/// A method with its usual settings for an elite of this size.
type Usual = fn(usize) -> Method;

/// Every method with its name.
const METHODS: [(&str, Usual); 3] = [
    ("cem", |elite| Method::Cem(Cem { elite })),
    ("icem", |elite| Method::Icem(Icem::new(elite))),
    ("mppi", |_| Method::Mppi(Mppi::default())),
];

impl Settings {
    /// Refuse settings with which no search can run.
    ///
    /// # Errors
    /// One sentence that names the key, its value and what it may be.
    pub fn check(&self) -> Result<(), SettingsError> {
        whole("population", self.population, CANDIDATES)?;
        whole("iterations", self.iterations, ITERATIONS)?;
        whole("horizon", self.horizon, HORIZON)?;
        self.method.search().check(self.population)
    }

    /// How much the search evaluates.
    pub fn size(&self) -> Size {
        Size {
            population: self.population,
            iterations: self.iterations,
            horizon: self.horizon,
        }
    }
}

impl Method {
    /// The names that files and the command line know.
    pub fn names() -> [&'static str; METHODS.len()] {
        METHODS.map(|(name, _)| name)
    }

    /// A method with its usual settings; methods that have an elite take the share published here for the cross-entropy
    /// method, 20 of 300.
    pub fn usual(name: &str, population: usize) -> Option<Self> {
        let elite = (population / 15).max(1);
        let method = METHODS.into_iter().find(|(known, _)| *known == name);
        method.map(|(_, usual)| usual(elite))
    }

    pub(super) fn search(self) -> Arc<dyn Search> {
        match self {
            Self::Cem(cem) => Arc::new(cem),
            Self::Icem(icem) => Arc::new(icem),
            Self::Mppi(mppi) => Arc::new(mppi),
        }
    }
}
