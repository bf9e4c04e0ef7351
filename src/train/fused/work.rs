use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use pulp::Arch;

use super::part::{Backward, Forward, Part};
use super::plan::{Numbers, Plan};
use crate::lanes::WorkerPool;
use crate::train::Frame;
use crate::train::loss::NORM_FLOOR;

/// The threads that losses are taken on, and memory that serves again for the next.
#[derive(Debug, Default)]
pub struct Crew {
    pool: WorkerPool,
    /// What the present round is about; held by the one who leads it.
    leading: Mutex<()>,
    task: Mutex<Option<Task>>,
    desks: Mutex<Vec<Arc<Desks>>>,
}

/// Work on every part of a loss.
#[derive(Debug, Clone)]
struct Task {
    plan: Arc<Plan>,
    desks: Arc<Desks>,
    way: Way,
}

#[derive(Debug, Clone, Copy)]
enum Way {
    Forward,
    /// From the derivatives by the sums that the way forward made.
    Backward([f32; 2]),
}

/// All that a loss of one model is worked out with.
#[derive(Debug)]
struct Desks {
    frame: Arc<Frame>,
    numbers: RwLock<Numbers>,
    parts: Vec<Mutex<Part>>,
}

/// A loss that was taken, and all that its derivative needs.
#[derive(Debug)]
pub(super) struct Work {
    crew: Arc<Crew>,
    plan: Arc<Plan>,
    desks: Arc<Desks>,
    /// E and the norm of F_r.
    pub loss: [f32; 2],
}

impl Crew {
    /// Call `lead` while other threads stand by for the losses in it. Without them it takes them alone.
    pub(in crate::train) fn helped<R>(&self, lead: impl FnOnce() -> R) -> R {
        self.pool.with_workers(&|part| self.carry_out(part), lead)
    }

    fn run(&self, task: Task) {
        let _leading = lock(&self.leading);
        let parts = task.desks.parts.len();
        *lock(&self.task) = Some(task);
        self.pool.run(parts, &|part| self.carry_out(part));
        *lock(&self.task) = None;
    }

    fn carry_out(&self, part: usize) {
        let task = lock(&self.task).clone();
        task.expect("a round has a task").carry_out(part);
    }

    /// Desks that nobody sits at.
    fn take(&self, frame: &Arc<Frame>, parts: usize) -> Arc<Desks> {
        let mut desks = lock(&self.desks);
        desks.retain(|desks| Arc::ptr_eq(&desks.frame, frame));
        let fitting = desks.iter().position(|desks| desks.parts.len() == parts);
        match fitting {
            Some(index) => desks.swap_remove(index),
            None => Arc::new(Desks {
                frame: frame.clone(),
                numbers: RwLock::new(Numbers::new(frame)),
                parts: (0..parts).map(|_| Mutex::new(Part::new(frame))).collect(),
            }),
        }
    }
}

impl Task {
    fn carry_out(&self, part: usize) {
        let numbers = &*self
            .desks
            .numbers
            .read()
            .unwrap_or_else(PoisonError::into_inner);
        let (plan, part) = (&*self.plan, &mut *lock(&self.desks.parts[part]));
        let arch = Arch::new();
        match self.way {
            Way::Forward => arch.dispatch(Forward {
                plan,
                numbers,
                part,
            }),
            Way::Backward(seeds) => arch.dispatch(Backward {
                plan,
                numbers,
                part,
                seeds,
            }),
        }
    }
}

impl Work {
    /// Take the loss with these numbers.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn new(plan: Arc<Plan>, crew: Arc<Crew>, prior: &[f32], residual: &[f32]) -> Self {
        let desks = crew.take(&plan.frame, plan.parts().count());
        let mut numbers = desks
            .numbers
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        numbers.set(&plan.frame, prior, residual);
        for (part, blocks) in desks.parts.iter().zip(plan.parts()) {
            lock(part).begin(blocks, &plan, &numbers);
        }
        drop(numbers);
        let mut work = Self {
            loss: [0.0; 2],
            crew,
            plan,
            desks,
        };
        work.run(Way::Forward);
        let count = work.plan.count();
        // In the order of the parts, so that the result does not hang on which was done first.
        let sums = work.desks.parts.iter().map(|part| lock(part).sums);
        let [error, square] = sums.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        let norm = match work.plan.frame.has_residual {
            true => (square / count + NORM_FLOOR * NORM_FLOOR).sqrt(),
            false => 0.0,
        };
        work.loss = [(error / count) as f32, norm as f32];
        work
    }

    /// From the derivatives of a number by the two parts of the loss to those by the prior's numbers and the
    /// residual's.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn derivative(&self, by_loss: [f32; 2]) -> [Vec<f32>; 2] {
        let (plan, loss) = (&self.plan, self.loss);
        let by_mean = match plan.frame.has_residual {
            true => f64::from(by_loss[1]) / (2.0 * f64::from(loss[1])),
            false => 0.0,
        };
        let seeds = [f64::from(by_loss[0]), by_mean].map(|by| (by / plan.count()) as f32);
        self.run(Way::Backward(seeds));
        gathered(&plan.frame, &self.desks.parts)
    }

    fn run(&self, way: Way) {
        self.crew.run(Task {
            plan: self.plan.clone(),
            desks: self.desks.clone(),
            way,
        });
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        lock(&self.crew.desks).push(self.desks.clone());
    }
}

/// A lock is poisoned only where a thread panicked, which ends the training.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The sum of what the parts found.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
fn gathered(frame: &Frame, parts: &[Mutex<Part>]) -> [Vec<f32>; 2] {
    let (first, others) = parts.split_first().expect("there is a part");
    let first = &mut *lock(first);
    for other in others {
        let other = lock(other);
        let networks = first.by_networks.iter_mut().zip(&other.by_networks);
        for (sum, more) in networks.flat_map(|(sums, more)| sums.iter_mut().zip(more)) {
            *sum += more;
        }
        for (sum, more) in first.by_parameters.iter_mut().zip(&other.by_parameters) {
            *sum += more;
        }
    }
    let mut free = first.by_parameters.iter();
    let parameters = frame.parameters().iter().map(|p| match p.fixed {
        true => 0.0,
        false => (free.next().expect("one number for each free parameter") * p.scale) as f32,
    });
    let mut networks = std::mem::take(&mut first.by_networks).into_iter();
    let prior = match frame.equations {
        None => networks.next().unwrap_or_default(),
        Some(_) => parameters.collect(),
    };
    [prior, networks.next().unwrap_or_default()]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::{Crew, Work};
    use crate::model::LastLayer;
    use crate::sim::Integrator;
    use crate::train::fused::plan::{KEPT, Plan};
    use crate::train::tests::{hybrid, transitions};
    use crate::train::{Backend, Batch};

    #[test]
    fn what_is_not_kept_is_worked_out_again_to_the_last_bit() {
        let segments = transitions(1000, -0.5, 1);
        let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Random);
        let Batch::Blocks(blocks) = segments.all(&model.device()) else {
            panic!("the processor's own backend takes blocks");
        };
        let numbers = model.tensors().map(|numbers| {
            let data = numbers.unwrap().into_data();
            data.iter().collect::<Vec<f32>>()
        });
        let derivative = |kept| {
            let plan = Plan {
                frame: model.frame().clone(),
                blocks: blocks.clone(),
                integrator: Integrator::RK4,
                precision: [1.0; 2].into(),
                kept,
            };
            let work = Work::new(
                Arc::new(plan),
                Arc::new(Crew::default()),
                &numbers[0],
                &numbers[1],
            );
            (work.loss, work.derivative([1.0, 0.3]))
        };
        assert_eq!(derivative(0), derivative(KEPT));
    }
}
