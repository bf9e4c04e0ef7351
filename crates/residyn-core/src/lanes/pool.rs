//! A worker pool for many short parallel loops. A loop of a tenth of a millisecond is over before a sleeping thread has
//! woken up, so the workers here stay awake from one loop to the next.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::yield_now;
use std::time::Duration;

/// How often an idle worker polls for a task, yielding in between (about a millisecond in all), before it starts to
/// sleep between polls.
const POLLS_AWAKE: usize = 4096;
const SLEEP: Duration = Duration::from_micros(100);

/// The tasks of the current loop. The calling thread takes tasks as the workers do and never waits for a worker that
/// has not started, so nested loops on the same threads cannot deadlock.
#[derive(Debug, Default)]
pub struct WorkerPool {
    /// Number of the loop (32 bits), how many tasks it has (16), and how many of them are taken (16).
    state: AtomicU64,
    /// Tasks that are not done.
    unfinished: AtomicUsize,
    stop: AtomicBool,
}

impl WorkerPool {
    /// A pool without a task.
    pub fn new() -> Self {
        Self::default()
    }

    /// Call `body` while worker threads take part in every [`WorkerPool::run`] within it, each of which must be given
    /// this `work`. There is a worker for every core of rayon's pool but the caller's, and none if the caller is itself
    /// a thread of that pool, whose cores are busy already.
    pub fn with_workers<R>(&self, work: &(impl Fn(usize) + Sync), body: impl FnOnce() -> R) -> R {
        let workers = match rayon::current_thread_index() {
            Some(_) => 0,
            None => rayon::current_num_threads() - 1,
        };
        self.stop.store(false, Ordering::Release);
        std::thread::scope(|scope| {
            let _stop = StopOnDrop(self);
            for _ in 0..workers {
                scope.spawn(|| self.serve(work));
            }
            body()
        })
    }

    /// Call `work` with every index below `tasks`, on this thread and on the workers.
    ///
    /// # Panics
    /// When there are more than 65 535 tasks.
    pub fn run(&self, tasks: usize, work: &impl Fn(usize)) {
        let tasks = u16::try_from(tasks).expect("at most 65 535 tasks");
        let number = (self.state.load(Ordering::Relaxed) >> 32) + 1;
        self.unfinished.store(usize::from(tasks), Ordering::Relaxed);
        self.state
            .store(number << 32 | u64::from(tasks) << 16, Ordering::Release);
        while let Some(task) = self.take() {
            self.call(work, task);
        }
        while self.unfinished.load(Ordering::Acquire) > 0 {
            // With fewer cores than threads, the worker that is waited for may need this core.
            yield_now();
        }
    }

    /// What a worker does until the pool stops.
    fn serve(&self, work: &impl Fn(usize)) {
        let mut polls = 0;
        while !self.stop.load(Ordering::Acquire) {
            if let Some(task) = self.take() {
                self.call(work, task);
                polls = 0;
            } else if polls < POLLS_AWAKE {
                polls += 1;
                yield_now();
            } else {
                std::thread::sleep(SLEEP);
            }
        }
    }

    /// Take a task of the current loop.
    fn take(&self) -> Option<usize> {
        let next = |state: u64| {
            let (tasks, taken) = (state >> 16 & 0xffff, state & 0xffff);
            (taken < tasks).then_some(state + 1)
        };
        let order = (Ordering::AcqRel, Ordering::Acquire);
        let before = self.state.fetch_update(order.0, order.1, next).ok()?;
        Some((before & 0xffff) as usize)
    }

    fn call(&self, work: &impl Fn(usize), task: usize) {
        let _done = DoneOnDrop(&self.unfinished);
        work(task);
    }
}

/// Counts a task as done even if it panics: the caller must not wait for ever.
struct DoneOnDrop<'a>(&'a AtomicUsize);

impl Drop for DoneOnDrop<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Stops the workers even if the caller panics.
struct StopOnDrop<'a>(&'a WorkerPool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.stop.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use rayon::prelude::*;

    use super::WorkerPool;

    /// Loops in which every task adds one to its own counter; returns the counters.
    fn counters_after(loops: usize) -> Vec<usize> {
        let counters: Vec<Mutex<usize>> = (0..37).map(|_| Mutex::new(0)).collect();
        let work = |task: usize| *counters[task].lock().unwrap() += 1;
        let pool = WorkerPool::new();
        pool.with_workers(&work, || {
            for count in 1..=loops {
                pool.run(counters.len(), &work);
                assert!(counters.iter().all(|n| *n.lock().unwrap() == count));
            }
        });
        counters
            .into_iter()
            .map(|n| n.into_inner().unwrap())
            .collect()
    }

    #[test]
    fn every_task_of_every_loop_is_done_once() {
        assert_eq!(counters_after(1000), [1000; 37]);
    }

    #[test]
    fn nested_loops_do_not_deadlock_on_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let all: Vec<_> =
                pool.install(|| (0..8).into_par_iter().map(|_| counters_after(50)).collect());
            assert_eq!(all, vec![vec![50; 37]; 8]);
        }
    }

    #[test]
    fn a_panic_in_a_task_ends_the_loop() {
        let done = AtomicUsize::new(0);
        let work = |task: usize| {
            done.fetch_add(1, Ordering::Relaxed);
            assert!(task != 3, "as it must");
        };
        let pool = WorkerPool::new();
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            pool.with_workers(&work, || pool.run(8, &work));
        }));
        assert!(ended.is_err());
    }
}
