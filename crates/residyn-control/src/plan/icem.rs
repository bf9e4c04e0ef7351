use serde::{Deserialize, Serialize};

use super::limits::{SettingsError, check_elite, within};
use super::method::Search;
use super::noise::Noise;
use super::population::Population;
use super::proposal::Proposal;

/// The improved cross-entropy method (Pinneri et al. 2020, arXiv 2008.06389): candidates have coloured noise, which
/// moves the rig instead of shaking it; the best ones are kept, within a search and for the next; distributions
/// follow the elite with momentum. The best candidate is the plan.
///
/// Unlike in the published method the population does not shrink over the iterations: the settings state the cost of a
/// search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Icem {
    /// Number of best candidates to which the distributions are fitted.
    pub elite: usize,
    /// beta: the power of the noise falls with the frequency f as f^-beta. 0 is white noise; published values are 0.25
    /// to 3.5, the higher the slower the desired motion.
    #[serde(default = "noise_exponent")]
    pub noise_exponent: f64,
    /// The share of the elite that is kept; at least the best candidate.
    #[serde(default = "keep")]
    pub keep: f64,
    /// alpha: the share of the old mean and standard deviation in the new.
    #[serde(default = "momentum")]
    pub momentum: f64,
}

fn noise_exponent() -> f64 {
    2.0
}

fn keep() -> f64 {
    0.3
}

fn momentum() -> f64 {
    0.1
}

impl Icem {
    /// With this elite, and the published values otherwise.
    pub fn new(elite: usize) -> Self {
        Self {
            elite,
            noise_exponent: noise_exponent(),
            keep: keep(),
            momentum: momentum(),
        }
    }
}

impl Search for Icem {
    fn check(&self, population: usize) -> Result<(), SettingsError> {
        check_elite(self.elite, population)?;
        let exponent = self.noise_exponent;
        within("noise_exponent", exponent, 0.0..=10.0, "from 0 to 10")?;
        within("keep", self.keep, 0.0..=1.0, "from 0 to 1")?;
        let below_one = "at least 0 and below 1";
        within("momentum", self.momentum, 0.0..1.0, below_one)
    }

    fn noise(&self, steps: usize, inputs: usize) -> Noise {
        Noise::coloured(steps, inputs, self.noise_exponent)
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of a small count
    fn learn(&self, population: &Population<'_>, proposal: &mut Proposal) {
        let elite = population.elite(self.elite);
        proposal.fit(population, &elite, self.momentum as f32);
        let kept = (self.keep * self.elite as f64).round().max(1.0) as usize;
        let kept = elite.iter().take(kept);
        proposal.keep(kept.map(|(_, index)| population.sequence(*index)).collect());
    }
}
