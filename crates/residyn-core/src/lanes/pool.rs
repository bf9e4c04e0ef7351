//! A worker pool for many short parallel loops. A loop of a tenth of a millisecond is over before a sleeping thread has
//! woken up, so the workers here stay awake from one loop to the next.

use std::hint::spin_loop;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::yield_now;
use std::time::Duration;

/// How often a waiting thread polls (for tens of microseconds) before it yields between polls. A thread that yields to one
/// with other work has its core back only after milliseconds, in which many loops could have run.
const POLLS_SPINNING: usize = 1024;
/// How often an idle worker polls (for about a millisecond) before it starts to sleep between polls.
const POLLS_AWAKE: usize = POLLS_SPINNING + 4096;
const SLEEP: Duration = Duration::from_micros(100);

/// The tasks of the current loop, in one queue per thread: in every loop a thread begins with the same tasks, whose data
/// are in its cache, and helps the others when its own are taken. The calling thread takes tasks as the workers do and
/// never waits for a worker that has not started, so nested loops on the same threads cannot deadlock.
#[derive(Debug)]
pub struct WorkerPool {
    queues: Vec<Queue>,
    /// Tasks that are not done.
    unfinished: AtomicUsize,
    stop: AtomicBool,
}

/// Successive tasks of a loop: its number (32 bits), the first task that belongs to the next queue (16), and the next task
/// to take (16). Queues do not share a cache line, nor the two that are fetched at once.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Queue(AtomicU64);

impl Queue {
    /// Begin the next loop with the tasks of this range.
    fn begin(&self, tasks: Range<usize>) {
        let number = (self.0.load(Ordering::Relaxed) >> 32) + 1;
        let state = number << 32 | (tasks.end as u64) << 16 | tasks.start as u64;
        self.0.store(state, Ordering::Release);
    }

    /// Take a task of the current loop.
    fn take(&self) -> Option<usize> {
        let next = |state: u64| {
            let (end, next) = (state >> 16 & 0xffff, state & 0xffff);
            (next < end).then_some(state + 1)
        };
        let order = (Ordering::AcqRel, Ordering::Acquire);
        let before = self.0.fetch_update(order.0, order.1, next).ok()?;
        Some((before & 0xffff) as usize)
    }
}

impl Default for WorkerPool {
    fn default() -> Self {
        Self::new()
    }
}

impl WorkerPool {
    /// A pool without a task, for as many threads as rayon's pool has.
    pub fn new() -> Self {
        let queues = (0..rayon::current_num_threads()).map(|_| Queue::default());
        Self {
            queues: queues.collect(),
            unfinished: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
        }
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
            for worker in 1..=workers {
                scope.spawn(move || self.serve(worker, work));
            }
            body()
        })
    }

    /// Call `work` with every index below `tasks`, on this thread and on the workers.
    ///
    /// # Panics
    /// When there are more than 65 535 tasks.
    pub fn run(&self, tasks: usize, work: &impl Fn(usize)) {
        let tasks = usize::from(u16::try_from(tasks).expect("at most 65 535 tasks"));
        self.unfinished.store(tasks, Ordering::Relaxed);
        let count = self.queues.len();
        for (k, queue) in self.queues.iter().enumerate() {
            queue.begin(k * tasks / count..(k + 1) * tasks / count);
        }
        while let Some(task) = self.take(0) {
            self.call(work, task);
        }
        let mut polls = 0;
        while self.unfinished.load(Ordering::Acquire) > 0 {
            // With fewer cores than threads, the worker that is waited for may need this core.
            wait(polls);
            polls += 1;
        }
    }

    /// What a worker does until the pool stops.
    fn serve(&self, worker: usize, work: &impl Fn(usize)) {
        let mut polls = 0;
        while !self.stop.load(Ordering::Acquire) {
            if let Some(task) = self.take(worker) {
                self.call(work, task);
                polls = 0;
            } else {
                wait(polls);
                polls += 1;
            }
        }
    }

    /// Take a task of this thread's queue, or else of the next one that has one.
    fn take(&self, thread: usize) -> Option<usize> {
        let (before, from) = self.queues.split_at(thread % self.queues.len());
        from.iter().chain(before).find_map(Queue::take)
    }

    fn call(&self, work: &impl Fn(usize), task: usize) {
        let _done = DoneOnDrop(&self.unfinished);
        work(task);
    }
}

/// Wait until the next poll, after this many.
fn wait(polls: usize) {
    match polls {
        ..POLLS_SPINNING => spin_loop(),
        POLLS_SPINNING..POLLS_AWAKE => yield_now(),
        _ => std::thread::sleep(SLEEP),
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
