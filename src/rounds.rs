//! Work in many short rounds on all cores. A round of a tenth of a millisecond is over before a sleeping thread has
//! woken up; here those who help stay awake from one round to the next.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::yield_now;
use std::time::Duration;

/// So many times a helper without a task looks for one and lets others run, about a millisecond; then it naps each time.
const AWAKE: usize = 4096;
const NAP: Duration = Duration::from_micros(100);

/// The tasks of the present round. One leads, others may help; the one who leads never waits for help that has not
/// begun, so that rounds within rounds on the same threads cannot block each other.
#[derive(Debug, Default)]
pub struct Rounds {
    /// Number of the round (32 bits), its tasks (16), and how many of them somebody has taken (16).
    state: AtomicU64,
    /// Tasks that are not done.
    left: AtomicUsize,
    over: AtomicBool,
}

impl Rounds {
    /// No round yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Call `lead`, while other threads carry out `work` on their share of the tasks of every [`Rounds::run`] in it,
    /// which must be given the same work. They are as many as rayon's pool has cores to use besides this one, and none
    /// on a thread of that pool: its cores have other work then.
    pub fn helped<R>(&self, work: &(impl Fn(usize) + Sync), lead: impl FnOnce() -> R) -> R {
        let helpers = match rayon::current_thread_index() {
            Some(_) => 0,
            None => rayon::current_num_threads() - 1,
        };
        self.over.store(false, Ordering::Release);
        std::thread::scope(|scope| {
            let _over = Over(self);
            for _ in 0..helpers {
                scope.spawn(|| self.help(work));
            }
            lead()
        })
    }

    /// Carry out `work` on every one of so many tasks, together with those who help.
    ///
    /// # Panics
    /// When there are more than 65 535 tasks.
    pub fn run(&self, tasks: usize, work: &impl Fn(usize)) {
        let tasks = u16::try_from(tasks).expect("few tasks, each of some size");
        let round = (self.state.load(Ordering::Relaxed) >> 32) + 1;
        self.left.store(usize::from(tasks), Ordering::Relaxed);
        self.state
            .store(round << 32 | u64::from(tasks) << 16, Ordering::Release);
        while let Some(task) = self.take() {
            self.carry_out(task, work);
        }
        while self.left.load(Ordering::Acquire) > 0 {
            // Where cores are fewer than threads, the one that is waited for may need this one.
            yield_now();
        }
    }

    fn help(&self, work: &impl Fn(usize)) {
        let mut looked = 0;
        while !self.over.load(Ordering::Acquire) {
            if let Some(task) = self.take() {
                self.carry_out(task, work);
                looked = 0;
            } else if looked < AWAKE {
                looked += 1;
                yield_now();
            } else {
                std::thread::sleep(NAP);
            }
        }
    }

    /// A task of the present round that nobody has.
    fn take(&self) -> Option<usize> {
        let next = |state: u64| {
            let (tasks, taken) = (state >> 16 & 0xffff, state & 0xffff);
            (taken < tasks).then_some(state + 1)
        };
        let order = (Ordering::AcqRel, Ordering::Acquire);
        let before = self.state.fetch_update(order.0, order.1, next).ok()?;
        Some((before & 0xffff) as usize)
    }

    fn carry_out(&self, task: usize, work: &impl Fn(usize)) {
        let _done = Done(&self.left);
        work(task);
    }
}

/// Counts a task as done, also where it panics: the one who leads must not wait for ever.
struct Done<'a>(&'a AtomicUsize);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Sends the helpers home, also where the one who leads panics.
struct Over<'a>(&'a Rounds);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.over.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use rayon::prelude::*;

    use super::Rounds;

    /// Rounds in which every task adds one to its own number; returns the numbers.
    fn counted(rounds: usize) -> Vec<usize> {
        let numbers: Vec<Mutex<usize>> = (0..37).map(|_| Mutex::new(0)).collect();
        let work = |task: usize| *numbers[task].lock().unwrap() += 1;
        let all = Rounds::new();
        all.helped(&work, || {
            for round in 1..=rounds {
                all.run(numbers.len(), &work);
                assert!(numbers.iter().all(|n| *n.lock().unwrap() == round));
            }
        });
        numbers
            .into_iter()
            .map(|n| n.into_inner().unwrap())
            .collect()
    }

    #[test]
    fn every_task_of_every_round_is_done_once() {
        assert_eq!(counted(1000), [1000; 37]);
    }

    #[test]
    fn rounds_do_not_block_each_other_on_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let all: Vec<_> =
                pool.install(|| (0..8).into_par_iter().map(|_| counted(50)).collect());
            assert_eq!(all, vec![vec![50; 37]; 8]);
        }
    }

    #[test]
    fn a_task_that_panics_ends_the_rounds() {
        let done = AtomicUsize::new(0);
        let work = |task: usize| {
            done.fetch_add(1, Ordering::Relaxed);
            assert!(task != 3, "as it must");
        };
        let rounds = Rounds::new();
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            rounds.helped(&work, || rounds.run(8, &work));
        }));
        assert!(ended.is_err());
    }
}
