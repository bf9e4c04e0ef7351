use super::limits::SettingsError;
use super::noise::Noise;
use super::population::Population;
use super::proposal::Proposal;

/// What distinguishes one search method from another.
pub trait Search: Send + Sync {
    /// Refuse settings that do not fit a population of this size.
    ///
    /// # Errors
    /// One sentence that names the key, its value and what it may be.
    fn check(&self, _population: usize) -> Result<(), SettingsError> {
        Ok(())
    }

    /// Standard deviation of the candidates in the first iteration, as a share of half an input's range.
    fn deviation(&self) -> f64 {
        0.5
    }

    /// The noise of candidates over `steps` steps of `inputs` inputs.
    fn noise(&self, steps: usize, inputs: usize) -> Noise {
        Noise::white(steps, inputs)
    }

    /// Update the sampling distribution from the evaluated population.
    fn learn(&self, population: &Population<'_>, proposal: &mut Proposal);
}
