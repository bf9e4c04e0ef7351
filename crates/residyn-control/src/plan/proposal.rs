use super::population::Population;
use residyn_core::lanes::{Arch, Element, Simd, Vector, WithSimd};
use residyn_core::sim::batch::{Rows, W};

/// Smallest standard deviation, as a share of half an input's range, so that a converged search can still move to a
/// better optimum.
const LEAST_DEVIATION: f32 = 1e-3;

/// The sampling distribution: an independent normal distribution for each entry of a sequence, `[step * n + input]`.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// Lowest and highest value of each input.
    bounds: Vec<[f32; 2]>,
    /// The middle of the bounds at every step.
    middle: Vec<f32>,
    mean: Vec<f32>,
    deviation: Vec<f32>,
    /// Sequences, best first, that replace the first candidates. After part of a plan has been executed they are
    /// shorter than the horizon, and the drawn values fill the rest.
    kept: Vec<Vec<f32>>,
    /// True until the first update of this search.
    first: bool,
}

impl Proposal {
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub(super) fn new(bounds: &[[f64; 2]], horizon: usize) -> Self {
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

    /// Start a search around the mean with this standard deviation, as a share of half an input's range.
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub(super) fn begin(&mut self, deviation: f64) {
        self.first = true;
        let share = 0.5 * deviation as f32;
        for (deviation, [low, high]) in self.deviation.iter_mut().zip(self.bounds.iter().cycle()) {
            *deviation = share * (high - low);
        }
    }

    pub(super) fn forget(&mut self) {
        self.mean.copy_from_slice(&self.middle);
        self.kept.clear();
    }

    /// Drop the first `steps`, which have been executed.
    pub(super) fn shift(&mut self, steps: usize) {
        let done = (steps * self.bounds.len()).min(self.mean.len());
        self.mean.rotate_left(done);
        let left = self.mean.len() - done;
        self.mean[left..].copy_from_slice(&self.middle[left..]);
        for sequence in &mut self.kept {
            sequence.drain(..done.min(sequence.len()));
        }
    }

    /// Fit mean and standard deviation to the elite; `momentum` is the share of the old values. Unchanged if all
    /// candidates diverged.
    pub fn fit(&mut self, population: &Population<'_>, elite: &[(f32, usize)], momentum: f32) {
        self.first = false;
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

    /// Set the mean to the weighted mean of all candidates. Unchanged if all diverged.
    pub fn average(&mut self, population: &Population<'_>, weight: impl Fn(f32) -> f32) {
        self.first = false;
        if let Some(mean) = population.mean(weight) {
            self.mean = mean;
        }
    }

    /// Sequences, best first, that become candidates again.
    pub fn keep(&mut self, sequences: Vec<Vec<f32>>) {
        self.kept = sequences;
    }

    /// The best kept sequence, or the mean if none is kept: `[step][input]`.
    pub(super) fn plan(&self) -> Vec<Vec<f64>> {
        let steps = self.kept.first().unwrap_or(&self.mean);
        steps
            .chunks(self.bounds.len())
            .map(|step| step.iter().copied().map(f64::from).collect())
            .collect()
    }

    /// Turn standard normal numbers into the candidates of the block with this index.
    pub(super) fn place(&self, arch: Arch, block: usize, inputs: &mut [Rows]) {
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

    /// The mean of a block's candidates. In the first iteration every other block starts from the middle of the bounds,
    /// because the rest of the last plan may lie near a worse optimum than a search from scratch finds.
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
            let (mean, deviation) = (Vector::splat(simd, *mean), Vector::splat(simd, *deviation));
            let [low, high] = *bounds;
            let (low, high) = (Vector::splat(simd, low), Vector::splat(simd, high));
            for number in f32::registers_mut::<S>(&mut **row) {
                let placed = Vector::new(simd, *number).mul_add(deviation, mean);
                *number = placed.max(low).min(high).register;
            }
        }
    }
}
