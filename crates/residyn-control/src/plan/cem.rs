use serde::{Deserialize, Serialize};

use super::limits::{SettingsError, check_elite};
use super::method::Search;
use super::population::Population;
use super::proposal::Proposal;

/// The cross-entropy method (Rubinstein 1999): draw sequences from normal distributions, refit mean and standard
/// deviation to the elite, and repeat. The mean is the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cem {
    /// Number of best candidates to which the distributions are fitted.
    pub elite: usize,
}

impl Search for Cem {
    fn check(&self, population: usize) -> Result<(), SettingsError> {
        check_elite(self.elite, population)
    }

    fn learn(&self, population: &Population<'_>, proposal: &mut Proposal) {
        proposal.fit(population, &population.elite(self.elite), 0.0);
    }
}
