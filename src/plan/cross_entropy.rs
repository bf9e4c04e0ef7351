use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use rand_chacha::ChaCha8Rng;

use super::gaussian::Gaussian;
use crate::batch::{Rows, W};
use crate::lanes::{Arch, Element, Simd, Vector, WithSimd};
use crate::rounds::Rounds;

/// Who knows what sequences of inputs bring. One of them serves one block of candidates.
pub trait Evaluate: Send {
    /// Where a plan starts.
    type Start: Send + Sync;

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
/// One who plans again and again does so within [`CrossEntropy::helped`].
///
/// Candidates outside of the bounds are drawn back to them before they are evaluated. The result is the same on any
/// number of processor cores: each block of candidates has a random stream of its own.
pub struct CrossEntropy<E: Evaluate> {
    settings: Settings,
    // Locks, since those who help share all of it with the one who leads. Nobody waits at them.
    start: RwLock<Option<E::Start>>,
    distribution: RwLock<Distribution>,
    blocks: Vec<Mutex<Candidates<E>>>,
    rounds: Rounds,
}

/// From what candidates are drawn: a normal distribution for each number of a sequence, `[step * n + input]`.
#[derive(Debug, Clone)]
struct Distribution {
    /// Of each input: lowest and highest value.
    bounds: Vec<[f32; 2]>,
    /// The middle of the bounds at every step.
    middle: Vec<f32>,
    mean: Vec<f32>,
    deviation: Vec<f32>,
    /// Whether no candidates have been drawn in this search.
    first: bool,
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
        Self {
            settings,
            distribution: RwLock::new(Distribution::new(bounds, horizon)),
            blocks: (0..population.div_ceil(W))
                .map(|index| Mutex::new(block(index)))
                .collect(),
            start: RwLock::new(None),
            rounds: Rounds::new(),
        }
    }

    /// Call `lead`, while all cores stay ready for the searches in it. Outside of it a search runs on one core.
    pub fn helped<R>(&self, lead: impl FnOnce() -> R) -> R {
        self.rounds
            .helped(&|index| self.draw_and_evaluate(index), lead)
    }

    /// Begin again in the middle of the bounds.
    pub fn forget(&self) {
        let Distribution { middle, mean, .. } = &mut *write(&self.distribution);
        mean.copy_from_slice(middle);
    }

    /// The first `steps` of the plan have been carried out: the next search starts from the rest, and from the
    /// middle of the bounds behind it.
    pub fn shift(&self, steps: usize) {
        write(&self.distribution).shift(steps);
    }

    /// Search for the best inputs from `start`.
    pub fn plan(&self, start: E::Start) -> Plan {
        *write(&self.start) = Some(start);
        write(&self.distribution).begin();
        let (mut ranking, mut diverged) = (Vec::with_capacity(self.settings.population), 0);
        for _ in 0..self.settings.iterations {
            let tasks = self.blocks.len();
            self.rounds
                .run(tasks, &|index| self.draw_and_evaluate(index));
            diverged += rank(&self.settings, &self.blocks, &mut ranking);
            write(&self.distribution).refit(&self.blocks, &ranking);
        }
        let best = ranking.first();
        Plan {
            inputs: read(&self.distribution).steps(),
            best: best.map_or(f64::NEG_INFINITY, |(best, _)| f64::from(*best)),
            diverged,
        }
    }

    fn draw_and_evaluate(&self, index: usize) {
        let mut block = lock(&self.blocks[index]);
        block.draw(&read(&self.distribution), index);
        block.evaluate(read(&self.start).as_ref().expect("a search has a start"));
    }
}

impl Distribution {
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    fn new(bounds: &[[f64; 2]], horizon: usize) -> Self {
        let bounds: Vec<[f32; 2]> = bounds.iter().map(|range| range.map(|x| x as f32)).collect();
        let centres = bounds.iter().map(|[low, high]| 0.5 * (low + high));
        let middle: Vec<f32> = centres.cycle().take(horizon * bounds.len()).collect();
        Self {
            mean: middle.clone(),
            deviation: vec![0.0; middle.len()],
            first: true,
            middle,
            bounds,
        }
    }

    /// As wide as at first, around the mean.
    fn begin(&mut self) {
        self.first = true;
        for (deviation, [low, high]) in self.deviation.iter_mut().zip(self.bounds.iter().cycle()) {
            *deviation = 0.25 * (high - low);
        }
    }

    fn shift(&mut self, steps: usize) {
        let done = (steps * self.bounds.len()).min(self.mean.len());
        self.mean.rotate_left(done);
        let left = self.mean.len() - done;
        self.mean[left..].copy_from_slice(&self.middle[left..]);
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

    /// Mean and standard deviation of the elite; where all candidates diverged the distribution stays.
    fn refit<E>(&mut self, blocks: &[Mutex<Candidates<E>>], elite: &[(f32, usize)]) {
        self.first = false;
        if elite.is_empty() {
            return;
        }
        let count = elite.len() as f32;
        let blocks: Vec<_> = blocks.iter().map(lock).collect();
        let numbers = self
            .mean
            .iter_mut()
            .zip(&mut self.deviation)
            .zip(self.bounds.iter().cycle());
        for (k, ((mean, deviation), [low, high])) in numbers.enumerate() {
            let values = elite.iter().map(|(_, i)| blocks[i / W].inputs[k][i % W]);
            *mean = values.clone().sum::<f32>() / count;
            let variance = values.map(|x| (x - *mean).powi(2)).sum::<f32>() / count;
            *deviation = variance.sqrt().max(LEAST_DEVIATION * 0.5 * (high - low));
        }
    }

    /// The means as `[step][input]`.
    fn steps(&self) -> Vec<Vec<f64>> {
        let steps = self.mean.chunks(self.bounds.len());
        steps
            .map(|step| step.iter().copied().map(f64::from).collect())
            .collect()
    }
}

/// Rank the elite, best first. Returns how many candidates diverged.
fn rank<E>(
    settings: &Settings,
    blocks: &[Mutex<Candidates<E>>],
    ranking: &mut Vec<(f32, usize)>,
) -> usize {
    ranking.clear();
    for (index, block) in blocks.iter().enumerate() {
        let returns = lock(block).returns;
        let numbered = returns.iter().copied().zip(index * W..settings.population);
        ranking.extend(numbered.filter(|(value, _)| value.is_finite()));
    }
    let finite = ranking.len();
    let best_first = |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    if finite > settings.elite {
        ranking.select_nth_unstable_by(settings.elite, best_first);
        ranking.truncate(settings.elite);
    }
    ranking.sort_unstable_by(best_first);
    settings.population - finite
}

// A lock is poisoned only where a thread panicked, which ends the search.

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read<T>(lock: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    lock.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(lock: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    lock.write().unwrap_or_else(PoisonError::into_inner)
}

impl<E: Evaluate> Candidates<E> {
    /// Draw the candidates of the block with this index.
    fn draw(&mut self, from: &Distribution, index: usize) {
        self.gaussian
            .fill(self.arch, &mut self.rng, &mut self.inputs);
        self.arch.dispatch(Place {
            bounds: &from.bounds,
            mean: from.mean_of(index),
            deviation: &from.deviation,
            inputs: &mut self.inputs,
        });
    }

    fn evaluate(&mut self, start: &E::Start) {
        self.evaluate
            .returns(start, &self.inputs, &mut self.returns);
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
