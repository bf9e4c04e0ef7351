use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::gaussian::Gaussian;
use crate::batch::{Rows, W};
use crate::lanes::{Arch, Element, Simd, Vector, WithSimd};

/// Who knows what sequences of inputs bring. One of them serves one block of candidates.
pub trait Evaluate: Send {
    /// Where a plan starts.
    type Start: Sync;

    /// The return of each candidate of a block from `start` under `inputs` (`[step * n + input]`); not a number or
    /// infinite where it cannot be told.
    fn returns(&mut self, start: &Self::Start, inputs: &[Rows], returns: &mut Rows);
}

/// How the cross-entropy method searches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Candidates drawn in each iteration.
    pub population: usize,
    /// The best of them, from which the next distribution is taken.
    pub elite: usize,
    pub iterations: usize,
    /// Steps of a plan.
    pub horizon: usize,
}

/// The cross-entropy method (Rubinstein 1999) for maximisation: draw sequences of inputs from normal
/// distributions, take mean and standard deviation of the elite, and again. The mean is the plan; what is left of it
/// after some steps starts the next search.
///
/// Candidates outside of the bounds are drawn back to them before they are evaluated. The result is the same on any
/// number of processor cores: each block of candidates has a random stream of its own.
pub struct CrossEntropy<E> {
    settings: Settings,
    /// Of each input: lowest and highest value.
    bounds: Vec<[f32; 2]>,
    /// The middle of the bounds at every step.
    middle: Vec<f32>,
    mean: Vec<f32>,
    deviation: Vec<f32>,
    blocks: Vec<Candidates<E>>,
    ranking: Vec<(f32, usize)>,
}

/// One block of candidates.
struct Candidates<E> {
    evaluate: E,
    rng: ChaCha8Rng,
    gaussian: Gaussian,
    arch: Arch,
    /// `[step * n + input]`
    inputs: Vec<Rows>,
    returns: Rows,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// `[step][input]`
    pub inputs: Vec<Vec<f64>>,
    /// The best return of a candidate in the last iteration; minus infinity where all of them diverged.
    pub best: f64,
    /// Candidates of all iterations whose return was not finite: they count as the worst.
    pub diverged: usize,
}

/// No distribution becomes narrower than this share of half an input's range: a search that has settled can still be
/// drawn away by a better optimum.
const LEAST_DEVIATION: f32 = 1e-3;

impl<E: Evaluate> CrossEntropy<E> {
    /// A search for inputs within `bounds`; `evaluate` makes one evaluator for each block of candidates.
    ///
    /// # Panics
    /// When there are no candidates, iterations, steps or bounds, fewer candidates than elite, or an empty range.
    pub fn new(
        settings: Settings,
        bounds: &[[f64; 2]],
        evaluate: impl Fn() -> E,
        rng: &ChaCha8Rng,
    ) -> Self {
        let Settings {
            population,
            elite,
            iterations,
            horizon,
        } = settings;
        assert!(
            (1..=population).contains(&elite),
            "an elite of the candidates"
        );
        assert!(
            iterations > 0 && horizon > 0 && !bounds.is_empty(),
            "something to search"
        );
        assert!(
            bounds.iter().all(|[low, high]| low < high),
            "ranges that are not empty"
        );
        let numbers = horizon * bounds.len();
        let block = |index: usize| {
            let mut rng = rng.clone();
            rng.set_stream(index as u64);
            Candidates {
                evaluate: evaluate(),
                rng,
                gaussian: Gaussian::new(numbers),
                arch: Arch::new(),
                inputs: vec![Rows::splat(0.0); numbers],
                returns: Rows::splat(0.0),
            }
        };
        #[allow(clippy::cast_possible_truncation)] // planning runs in f32
        let bounds: Vec<[f32; 2]> = bounds.iter().map(|range| range.map(|x| x as f32)).collect();
        let centres = bounds.iter().map(|[low, high]| 0.5 * (low + high));
        let middle: Vec<f32> = centres.cycle().take(numbers).collect();
        Self {
            settings,
            mean: middle.clone(),
            middle,
            deviation: vec![0.0; numbers],
            blocks: (0..population.div_ceil(W)).map(block).collect(),
            ranking: Vec::with_capacity(population),
            bounds,
        }
    }

    /// Begin again in the middle of the bounds.
    pub fn forget(&mut self) {
        self.mean.copy_from_slice(&self.middle);
    }

    /// Search for the best inputs from `start`.
    pub fn plan(&mut self, start: &E::Start) -> Plan {
        for (deviation, [low, high]) in self.deviation.iter_mut().zip(self.bounds.iter().cycle()) {
            *deviation = 0.25 * (high - low);
        }
        let mut diverged = 0;
        // Within the pool the iterations hand their blocks over without waking it each time.
        rayon::scope(|_| {
            for iteration in 0..self.settings.iterations {
                self.evaluate(start, iteration == 0);
                diverged += self.rank();
                self.refit();
            }
        });
        let inputs = self.mean.chunks(self.bounds.len());
        Plan {
            inputs: inputs
                .map(|step| step.iter().copied().map(f64::from).collect())
                .collect(),
            best: self
                .ranking
                .first()
                .map_or(f64::NEG_INFINITY, |(best, _)| f64::from(*best)),
            diverged,
        }
    }

    /// The first `steps` of the plan have been carried out: the next search starts from the rest, and from the
    /// middle of the bounds behind it.
    pub fn shift(&mut self, steps: usize) {
        let done = (steps * self.bounds.len()).min(self.mean.len());
        self.mean.rotate_left(done);
        let left = self.mean.len() - done;
        self.mean[left..].copy_from_slice(&self.middle[left..]);
    }

    /// Draw all candidates and ask what they bring. At first every other block starts from the middle of the bounds:
    /// what is left of a plan can lead into a worse optimum than a search that knows nothing.
    fn evaluate(&mut self, start: &E::Start, first: bool) {
        let Self {
            bounds,
            middle,
            mean,
            deviation,
            ..
        } = self;
        let blocks = self.blocks.par_iter_mut().enumerate();
        blocks.for_each(|(index, block)| {
            let fresh = first && index % 2 == 1;
            let mean: &[f32] = if fresh { middle } else { mean };
            block.draw(bounds, mean, deviation);
            let Candidates {
                evaluate,
                inputs,
                returns,
                ..
            } = block;
            evaluate.returns(start, inputs, returns);
        });
    }

    /// Order the elite first. Returns how many candidates diverged.
    fn rank(&mut self) -> usize {
        let Settings {
            population, elite, ..
        } = self.settings;
        let returns = self
            .blocks
            .iter()
            .flat_map(|block| block.returns.iter().copied());
        self.ranking.clear();
        self.ranking.extend(
            returns
                .take(population)
                .zip(0..)
                .filter(|(r, _)| r.is_finite()),
        );
        let best_first =
            |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        let finite = self.ranking.len();
        if finite > elite {
            self.ranking.select_nth_unstable_by(elite, best_first);
            self.ranking.truncate(elite);
        }
        self.ranking.sort_unstable_by(best_first);
        population - finite
    }

    /// Mean and standard deviation of the elite; where all candidates diverged the distribution stays.
    fn refit(&mut self) {
        if self.ranking.is_empty() {
            return;
        }
        let count = self.ranking.len() as f32;
        let ranges = self.bounds.iter().cycle();
        let numbers = self.mean.iter_mut().zip(&mut self.deviation).zip(ranges);
        for (k, ((mean, deviation), [low, high])) in numbers.enumerate() {
            let elite = self
                .ranking
                .iter()
                .map(|(_, i)| self.blocks[i / W].inputs[k][i % W]);
            *mean = elite.clone().sum::<f32>() / count;
            let variance = elite.map(|x| (x - *mean).powi(2)).sum::<f32>() / count;
            *deviation = variance.sqrt().max(LEAST_DEVIATION * 0.5 * (high - low));
        }
    }
}

impl<E> Candidates<E> {
    fn draw(&mut self, bounds: &[[f32; 2]], mean: &[f32], deviation: &[f32]) {
        self.gaussian
            .fill(self.arch, &mut self.rng, &mut self.inputs);
        self.arch.dispatch(Place {
            bounds,
            mean,
            deviation,
            inputs: &mut self.inputs,
        });
    }
}

/// Standard normal numbers become candidates.
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
