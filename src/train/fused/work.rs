use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use pulp::Arch;

use super::part::{Backward, Forward, Part};
use super::plan::{Numbers, Plan};
use crate::lanes::WorkerPool;
use crate::train::Frame;
use crate::train::loss::NORM_FLOOR;

/// The threads that evaluate losses, and the idle buffers of earlier evaluations.
#[derive(Debug, Default)]
pub struct Workers {
    pool: WorkerPool,
    /// Held by the thread that submits the current task.
    leading: Mutex<()>,
    task: Mutex<Option<Task>>,
    idle: Mutex<Vec<Arc<Buffers>>>,
}

/// One pass over every part of a batch.
#[derive(Debug, Clone)]
struct Task {
    plan: Arc<Plan>,
    buffers: Arc<Buffers>,
    pass: Pass,
}

#[derive(Debug, Clone, Copy)]
enum Pass {
    Forward,
    /// From the derivatives of the loss by the sums of the forward pass.
    Backward([f32; 2]),
}

/// Buffers for evaluating the loss of one model.
#[derive(Debug)]
struct Buffers {
    frame: Arc<Frame>,
    numbers: RwLock<Numbers>,
    parts: Vec<Mutex<Part>>,
}

/// An evaluated loss, with everything its derivative needs.
#[derive(Debug)]
pub(super) struct Work {
    workers: Arc<Workers>,
    plan: Arc<Plan>,
    buffers: Arc<Buffers>,
    /// E and the norm of F_r.
    pub loss: [f32; 2],
}

impl Workers {
    /// Call `lead` while the worker threads wait for the losses in it. Outside of this call losses run on one thread.
    pub(in crate::train) fn helped<R>(&self, lead: impl FnOnce() -> R) -> R {
        self.pool.with_workers(&|part| self.carry_out(part), lead)
    }

    fn run(&self, task: Task) {
        let _leading = lock(&self.leading);
        let parts = task.buffers.parts.len();
        *lock(&self.task) = Some(task);
        self.pool.run(parts, &|part| self.carry_out(part));
        *lock(&self.task) = None;
    }

    fn carry_out(&self, part: usize) {
        let task = lock(&self.task).clone();
        task.expect("a round has a task").carry_out(part);
    }

    /// Idle buffers of this shape, or new ones.
    fn take(&self, frame: &Arc<Frame>, parts: usize) -> Arc<Buffers> {
        let mut idle = lock(&self.idle);
        idle.retain(|buffers| Arc::ptr_eq(&buffers.frame, frame));
        let fitting = idle.iter().position(|buffers| buffers.parts.len() == parts);
        match fitting {
            Some(index) => idle.swap_remove(index),
            None => Arc::new(Buffers {
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
            .buffers
            .numbers
            .read()
            .unwrap_or_else(PoisonError::into_inner);
        let (plan, part) = (&*self.plan, &mut *lock(&self.buffers.parts[part]));
        let arch = Arch::new();
        match self.pass {
            Pass::Forward => arch.dispatch(Forward {
                plan,
                numbers,
                part,
            }),
            Pass::Backward(seeds) => arch.dispatch(Backward {
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
    pub(super) fn new(
        plan: Arc<Plan>,
        workers: Arc<Workers>,
        prior: &[f32],
        residual: &[f32],
    ) -> Self {
        let buffers = workers.take(&plan.frame, plan.parts().count());
        let mut numbers = buffers
            .numbers
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        numbers.set(&plan.frame, prior, residual);
        for (part, blocks) in buffers.parts.iter().zip(plan.parts()) {
            lock(part).begin(blocks, &plan, &numbers);
        }
        drop(numbers);
        let mut work = Self {
            loss: [0.0; 2],
            workers,
            plan,
            buffers,
        };
        work.run(Pass::Forward);
        let count = work.plan.count();
        // In the order of the parts, so that the result does not hang on which was done first.
        let sums = work.buffers.parts.iter().map(|part| lock(part).sums);
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
        self.run(Pass::Backward(seeds));
        gathered(&plan.frame, &self.buffers.parts)
    }

    fn run(&self, pass: Pass) {
        self.workers.run(Task {
            plan: self.plan.clone(),
            buffers: self.buffers.clone(),
            pass,
        });
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        lock(&self.workers.idle).push(self.buffers.clone());
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

    use super::{Work, Workers};
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
                Arc::new(Workers::default()),
                &numbers[0],
                &numbers[1],
            );
            (work.loss, work.derivative([1.0, 0.3]))
        };
        assert_eq!(derivative(0), derivative(KEPT));
    }
}
