use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use rand_chacha::ChaCha8Rng;

use super::method::Search;
use super::noise::Noise;
use super::population::{Evaluated, Population};
use super::proposal::Proposal;
use super::settings::{Settings, Size};
use residyn_core::lanes::{Arch, WorkerPool};
use residyn_core::sim::batch::{Rows, W};

/// Evaluates candidate input sequences. There is one evaluator for each block of candidates.
pub trait Evaluate: Send {
    /// Initial condition of a plan, with everything that all candidates share.
    type Start: Send + Sync;

    /// The return of each candidate of a block from `start` under `inputs` (`[step * n + input]`); NaN or infinite if
    /// the rollout diverges.
    fn returns(&mut self, start: &Self::Start, inputs: &[Rows], returns: &mut Rows);

    /// How far each of the candidates that were evaluated last goes beyond limits, 0 within; `None` without limits.
    fn excess(&self) -> Option<&Rows> {
        None
    }
}

/// A search for the inputs that maximise a return, by the [`Method`](super::Method) of its settings or a [`Search`] of
/// your own: draw sequences, evaluate them, and draw the next ones near the best. The rest of a plan is the initial guess of the next search.
///
/// Plan repeatedly within [`Planner::with_workers`] to use all cores.
///
/// Candidates are clipped to the bounds before they are evaluated. The result is the same on any number of processor
/// cores: each block of candidates has its own random stream. Candidates beyond limits rank below all within.
pub struct Planner<E: Evaluate> {
    search: Arc<dyn Search>,
    size: Size,
    // Locks, since the workers share all of it with the calling thread. They are never contended.
    start: RwLock<Option<E::Start>>,
    proposal: RwLock<Proposal>,
    blocks: Vec<Mutex<Candidates<E>>>,
    pool: WorkerPool,
}

/// One block of candidates.
struct Candidates<E> {
    evaluate: E,
    rng: ChaCha8Rng,
    noise: Noise,
    arch: Arch,
    /// `[step * n + input]`
    inputs: Vec<Rows>,
    returns: Rows,
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// `[step][input]`
    pub inputs: Vec<Vec<f64>>,
    /// The best value of a candidate in the last iteration, the return if any keeps the limits; minus infinity if all of them
    /// diverged.
    pub best: f64,
    /// Number of candidates, over all iterations, whose return was not finite; they rank last.
    pub diverged: usize,
}

impl<E: Evaluate> Planner<E> {
    /// A search for inputs within `bounds`; `evaluate` makes one evaluator for each block of candidates.
    ///
    /// # Panics
    /// When [`Settings::check`] refuses the settings, or there are no bounds or an empty range.
    pub fn new(
        settings: &Settings,
        bounds: &[[f64; 2]],
        evaluate: impl Fn() -> E,
        rng: &ChaCha8Rng,
    ) -> Self {
        settings.check().expect("settings that have been checked");
        let (search, size) = (settings.method.search(), settings.size());
        Self::by(search, size, bounds, evaluate, rng)
    }

    /// The same by any method.
    ///
    /// # Panics
    /// When there are no bounds or an empty range.
    pub fn by(
        search: Arc<dyn Search>,
        size: Size,
        bounds: &[[f64; 2]],
        evaluate: impl Fn() -> E,
        rng: &ChaCha8Rng,
    ) -> Self {
        assert!(!bounds.is_empty(), "something to search");
        let are_ranges = bounds.iter().all(|[low, high]| low <= high);
        assert!(are_ranges, "ranges that are not empty");
        let noise = search.noise(size.horizon, bounds.len());
        let block = |index: usize| {
            let mut rng = rng.clone();
            rng.set_stream(index as u64);
            Candidates {
                evaluate: evaluate(),
                rng,
                noise: noise.clone(),
                arch: Arch::new(),
                inputs: vec![Rows::splat(0.0); size.horizon * bounds.len()],
                returns: Rows::splat(0.0),
            }
        };
        Self {
            search,
            size,
            start: RwLock::new(None),
            proposal: RwLock::new(Proposal::new(bounds, size.horizon)),
            blocks: (0..size.population.div_ceil(W))
                .map(|index| Mutex::new(block(index)))
                .collect(),
            pool: WorkerPool::new(),
        }
    }

    /// Call `body` with all cores available to the searches in it. Outside it a search runs on one core.
    pub fn with_workers<R>(&self, body: impl FnOnce() -> R) -> R {
        self.pool
            .with_workers(&|index| self.draw_and_evaluate(index), body)
    }

    /// Discard the last plan: the next search starts from the middle of the bounds.
    pub fn forget(&self) {
        write(&self.proposal).forget();
    }

    /// Drop the first `steps` of the plan, which have been executed: the next search starts from the rest, continued
    /// by the middle of the bounds.
    pub fn shift(&self, steps: usize) {
        write(&self.proposal).shift(steps);
    }

    /// Steps of a plan.
    pub fn horizon(&self) -> usize {
        self.size.horizon
    }

    /// Search for the best inputs from `start`.
    pub fn plan(&self, start: E::Start) -> Plan {
        *write(&self.start) = Some(start);
        write(&self.proposal).begin(self.search.deviation());
        let (mut best, mut diverged) = (f32::NEG_INFINITY, 0);
        for _ in 0..self.size.iterations {
            let tasks = self.blocks.len();
            self.pool.run(tasks, &|index| self.draw_and_evaluate(index));
            let blocks: Vec<_> = self.blocks.iter().map(lock).collect();
            let evaluated = blocks.iter().map(|block| Evaluated {
                inputs: &block.inputs,
                returns: &block.returns,
                excess: block.evaluate.excess(),
            });
            let population = Population::new(evaluated, self.size.population);
            let mut proposal = write(&self.proposal);
            self.search.learn(&population, &mut proposal);
            best = population.best();
            diverged += population.diverged();
        }
        Plan {
            inputs: read(&self.proposal).plan(),
            best: f64::from(best),
            diverged,
        }
    }

    fn draw_and_evaluate(&self, index: usize) {
        let block = &mut *lock(&self.blocks[index]);
        let (arch, inputs) = (block.arch, &mut block.inputs);
        block.noise.fill(arch, &mut block.rng, inputs);
        read(&self.proposal).place(arch, index, inputs);
        let start = read(&self.start);
        let start = start.as_ref().expect("a search has a start");
        block.evaluate.returns(start, inputs, &mut block.returns);
    }
}

// A lock is poisoned only after a panic, which ends the search anyway.

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read<T>(lock: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    lock.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(lock: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    lock.write().unwrap_or_else(PoisonError::into_inner)
}
