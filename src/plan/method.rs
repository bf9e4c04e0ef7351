use super::noise::Noise;
use super::population::Population;
use super::proposal::Proposal;

/// What methods of search differ in.
pub trait Search {
    /// Refuse settings that a search among so many candidates cannot run with.
    ///
    /// # Errors
    /// One sentence that names the key, its value and what it may be.
    fn check(&self, population: usize) -> Result<(), String>;

    /// Standard deviation of the candidates in the first iteration, as a share of half an input's range.
    fn deviation(&self) -> f64 {
        0.5
    }

    /// How candidates scatter over `steps` of so many inputs.
    fn noise(&self, steps: usize, inputs: usize) -> Noise {
        Noise::white(steps, inputs)
    }

    /// Draw the next candidates where the last ones were good.
    fn learn(&self, population: &Population<'_>, proposal: &mut Proposal);
}
