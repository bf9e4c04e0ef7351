use super::method::Search;
use super::population::Population;
use crate::lanes::{Arch, Element, Simd, Vector, WithSimd};
use crate::sim::batch::{Rows, W};

/// No distribution becomes narrower than this share of half an input's range: a search that has settled can still be
/// drawn away by a better optimum.
const LEAST_DEVIATION: f32 = 1e-3;

/// From what candidates are drawn: a normal distribution for each number of a sequence, `[step * n + input]`.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// Of each input: lowest and highest value.
    bounds: Vec<[f32; 2]>,
    /// The middle of the bounds at every step.
    middle: Vec<f32>,
    mean: Vec<f32>,
    deviation: Vec<f32>,
    /// Sequences, best first, that take the place of the first candidates; those of a plan that has been carried
    /// out in part are short, and candidates keep what was drawn behind them.
    kept: Vec<Vec<f32>>,
    /// Whether nothing has been learnt in this search.
    first: bool,
}

impl Proposal {
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn new(bounds: &[[f64; 2]], horizon: usize) -> Self {
        let bounds: Vec<[f32; 2]> = bounds.iter().map(|range| range.map(|x| x as f32)).collect();
        let centres = bounds.iter().map(|[low, high]| 0.5 * (low + high));
        let middle: Vec<f32> = centres.cycle().take(horizon * bounds.len()).collect();
        Self {
            mean: middle.clone(),
            deviation: vec![0.0; middle.len()],
            kept: Vec::new(),
            first: true,
            middle,
            bounds,
        }
    }

    /// A new search around the mean, with this share of half an input's range as standard deviation.
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn begin(&mut self, deviation: f64) {
        self.first = true;
        let share = 0.5 * deviation as f32;
        for (deviation, [low, high]) in self.deviation.iter_mut().zip(self.bounds.iter().cycle()) {
            *deviation = share * (high - low);
        }
    }

    /// Draw the next candidates where those of `population` were good.
    pub fn learn(&mut self, population: &Population<'_>, search: &dyn Search) {
        self.first = false;
        search.learn(population, self);
    }

    pub fn forget(&mut self) {
        self.mean.copy_from_slice(&self.middle);
        self.kept.clear();
    }

    /// The first `steps` have been carried out.
    pub fn shift(&mut self, steps: usize) {
        let done = (steps * self.bounds.len()).min(self.mean.len());
        self.mean.rotate_left(done);
        let left = self.mean.len() - done;
        self.mean[left..].copy_from_slice(&self.middle[left..]);
        for sequence in &mut self.kept {
            sequence.drain(..done.min(sequence.len()));
        }
    }

    /// Mean and standard deviation become those of the elite, with `momentum` as the share of what they were.
    /// Where all candidates diverged they stay.
    pub fn fit(&mut self, population: &Population<'_>, elite: &[(f32, usize)], momentum: f32) {
        if elite.is_empty() {
            return;
        }
        let count = elite.len() as f32;
        let numbers = self
            .mean
            .iter_mut()
            .zip(&mut self.deviation)
            .zip(self.bounds.iter().cycle());
        for (k, ((mean, deviation), [low, high])) in numbers.enumerate() {
            let values = elite.iter().map(|(_, i)| population.number(*i, k));
            let centre = values.clone().sum::<f32>() / count;
            let variance = values.map(|x| (x - centre).powi(2)).sum::<f32>() / count;
            let width = variance.sqrt();
            *mean = centre + momentum * (*mean - centre);
            *deviation =
                (width + momentum * (*deviation - width)).max(LEAST_DEVIATION * 0.5 * (high - low));
        }
    }

    /// The mean becomes that of all candidates with these weights of their returns. Where all diverged it stays.
    pub fn average(&mut self, population: &Population<'_>, weight: impl Fn(f32) -> f32) {
        if let Some(mean) = population.mean(weight) {
            self.mean = mean;
        }
    }

    /// Sequences, best first, that are candidates again.
    pub fn keep(&mut self, sequences: Vec<Vec<f32>>) {
        self.kept = sequences;
    }

    /// The best sequence that was kept, else the mean, as `[step][input]`.
    pub fn plan(&self) -> Vec<Vec<f64>> {
        let steps = self.kept.first().unwrap_or(&self.mean);
        steps
            .chunks(self.bounds.len())
            .map(|step| step.iter().copied().map(f64::from).collect())
            .collect()
    }

    /// Standard normal numbers become the candidates of the block with this index.
    pub fn place(&self, arch: Arch, block: usize, inputs: &mut [Rows]) {
        arch.dispatch(Place {
            bounds: &self.bounds,
            mean: self.mean_of(block),
            deviation: &self.deviation,
            inputs,
        });
        for (lane, sequence) in self.kept.iter().skip(block * W).take(W).enumerate() {
            for (row, number) in inputs.iter_mut().zip(sequence) {
                row[lane] = *number;
            }
        }
    }

    /// The means that candidates of a block are drawn around. At first every other block starts from the middle of
    /// the bounds: what is left of a plan can lead into a worse optimum than a search that knows nothing.
    fn mean_of(&self, block: usize) -> &[f32] {
        if self.first && block % 2 == 1 {
            &self.middle
        } else {
            &self.mean
        }
    }
}

struct Place<'a> {
    bounds: &'a [[f32; 2]],
    mean: &'a [f32],
    deviation: &'a [f32],
    inputs: &'a mut [Rows],
}

impl WithSimd for Place<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let spread = self
            .mean
            .iter()
            .zip(self.deviation)
            .zip(self.bounds.iter().cycle());
        for (row, ((mean, deviation), bounds)) in self.inputs.iter_mut().zip(spread) {
            let [mean, deviation, low, high] =
                [*mean, *deviation, bounds[0], bounds[1]].map(|x| Vector::splat(simd, x));
            for number in f32::registers_mut::<S>(&mut **row) {
                let placed = Vector::new(simd, *number).mul_add(deviation, mean);
                *number = placed.max(low).min(high).register;
            }
        }
    }
}
