use serde::{Deserialize, Serialize};

use super::limits::{SettingsError, within};
use super::method::Search;
use super::population::Population;
use super::proposal::Proposal;

/// Model-predictive path-integral control (Williams et al. 2017): the next mean is the mean of all candidates with
/// weights exp((return - best) / scale). The standard deviation stays fixed. The mean is the plan.
///
/// A temperature in units of return would have to be tuned for every objective, rig and horizon. Here it is a share
/// of the spread of the population's returns, from the best to the median: scaling or shifting the objective gives
/// the same plans, and a few very bad candidates, which would dominate a standard deviation, have no influence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mppi {
    /// How much worse than the best a candidate with 1/e of its weight is, as a share of the spread.
    pub temperature: f64,
    /// Standard deviation of the candidates, as a share of half an input's range.
    pub deviation: f64,
}

impl Default for Mppi {
    fn default() -> Self {
        Self {
            temperature: 0.05,
            deviation: 0.5,
        }
    }
}

impl Search for Mppi {
    fn check(&self, _: usize) -> Result<(), SettingsError> {
        let above_zero = "above 0 and at most 10";
        let check = |key, value| within(key, value, f64::MIN_POSITIVE..=10.0, above_zero);
        check("temperature", self.temperature)?;
        check("deviation", self.deviation)
    }

    fn deviation(&self) -> f64 {
        self.deviation
    }

    fn learn(&self, population: &Population<'_>, proposal: &mut Proposal) {
        let (best, median) = (population.best(), population.median());
        // Without a spread all weights are equal: zero over anything is zero.
        let scale = (self.temperature as f32 * (best - median)).max(f32::MIN_POSITIVE);
        proposal.average(population, |value| ((value - best) / scale).exp());
    }
}
