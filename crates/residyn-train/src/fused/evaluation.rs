use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use pulp::Arch;

use super::part::{Part, Pass, PassOver};
use super::problem::{Problem, Weights};
use crate::Structure;
use crate::composed::NORM_FLOOR;
use residyn_core::lanes::WorkerPool;
use residyn_core::sim::batch::Network;

/// The threads that evaluate losses, and the idle buffers of earlier evaluations.
#[derive(Debug, Default)]
pub struct Workers {
    pool: WorkerPool,
    /// Held by the thread that submits the current task.
    submission: Mutex<()>,
    task: Mutex<Option<Task>>,
    idle: Mutex<Vec<Arc<Buffers>>>,
}

/// One pass over every part of a batch.
#[derive(Debug, Clone)]
struct Task {
    problem: Arc<Problem>,
    buffers: Arc<Buffers>,
    pass: Pass,
}

/// Buffers for evaluating the loss of one model.
#[derive(Debug)]
struct Buffers {
    structure: Arc<Structure>,
    weights: RwLock<Weights>,
    parts: Vec<Mutex<Part>>,
}

/// An evaluated loss, with everything its derivative needs.
#[derive(Debug)]
pub(super) struct Evaluation {
    workers: Arc<Workers>,
    problem: Arc<Problem>,
    buffers: Arc<Buffers>,
    /// E and the norm of F_r.
    pub loss: [f32; 2],
}

impl Workers {
    /// Calls `body` with all cores available to the losses in it. Outside this call, losses run on one thread.
    pub(crate) fn with_workers<R>(&self, body: impl FnOnce() -> R) -> R {
        self.pool.with_workers(&|part| self.run_part(part), body)
    }

    fn run(&self, task: Task) {
        let _submission = lock(&self.submission);
        let parts = task.buffers.parts.len();
        *lock(&self.task) = Some(task);
        self.pool.run(parts, &|part| self.run_part(part));
        *lock(&self.task) = None;
    }

    fn run_part(&self, part: usize) {
        let task = lock(&self.task).clone();
        task.expect("a round has a task").run_part(part);
    }

    /// Idle buffers of this shape, or new ones.
    fn take(&self, structure: &Arc<Structure>, parts: usize) -> Arc<Buffers> {
        let mut idle = lock(&self.idle);
        idle.retain(|buffers| Arc::ptr_eq(&buffers.structure, structure));
        let fitting = idle.iter().position(|buffers| buffers.parts.len() == parts);
        match fitting {
            Some(index) => idle.swap_remove(index),
            None => Arc::new(Buffers {
                structure: structure.clone(),
                weights: RwLock::new(Weights::new(structure)),
                parts: (0..parts)
                    .map(|_| Mutex::new(Part::new(structure)))
                    .collect(),
            }),
        }
    }
}

impl Task {
    fn run_part(&self, part: usize) {
        let weights = self.buffers.weights.read();
        Arch::new().dispatch(PassOver {
            pass: self.pass,
            part: &mut lock(&self.buffers.parts[part]),
            problem: &self.problem,
            weights: &weights.unwrap_or_else(PoisonError::into_inner),
        });
    }
}

impl Evaluation {
    /// Evaluates the loss with these learnable numbers, in the order of
    /// [`HybridModel::flat`](crate::HybridModel::flat).
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn new(problem: Arc<Problem>, workers: Arc<Workers>, numbers: &[f32]) -> Self {
        let buffers = workers.take(&problem.structure, problem.parts().count());
        let mut weights = buffers
            .weights
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        weights.set(&problem.structure, numbers);
        for (part, blocks) in buffers.parts.iter().zip(problem.parts()) {
            lock(part).begin(blocks, &problem, &weights);
        }
        drop(weights);
        let mut evaluation = Self {
            loss: [0.0; 2],
            workers,
            problem,
            buffers,
        };
        evaluation.run(Pass::Forward);
        let count = evaluation.problem.count();
        // In the order of the parts, so that the result does not depend on which finished first.
        let sums = evaluation.buffers.parts.iter().map(|part| lock(part).sums);
        let [error, square] = sums.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        let norm = match evaluation.problem.structure.has_residual {
            true => (square / count + NORM_FLOOR * NORM_FLOOR).sqrt(),
            false => 0.0,
        };
        evaluation.loss = [(error / count) as f32, norm as f32];
        evaluation
    }

    /// From the derivatives of a quantity by the two parts of the loss to its derivatives by the learnable numbers.
    #[allow(clippy::cast_possible_truncation)] // training runs in f32
    pub(super) fn derivative(&self, by_loss: [f32; 2]) -> Vec<f32> {
        let (problem, norm) = (&self.problem, self.loss[1]);
        let by_loss = by_loss.map(f64::from);
        let by_mean = match problem.structure.has_residual {
            true => by_loss[1] / (2.0 * f64::from(norm)),
            false => 0.0,
        };
        let seeds = [by_loss[0], by_mean].map(|by| (by / problem.count()) as f32);
        self.run(Pass::Reverse(seeds));
        let weights = self.buffers.weights.read();
        let networks = &weights.unwrap_or_else(PoisonError::into_inner).networks;
        summed(&problem.structure, networks, &self.buffers.parts)
    }

    fn run(&self, pass: Pass) {
        self.workers.run(Task {
            problem: self.problem.clone(),
            buffers: self.buffers.clone(),
            pass,
        });
    }
}

impl Drop for Evaluation {
    fn drop(&mut self) {
        lock(&self.workers.idle).push(self.buffers.clone());
    }
}

/// A lock is poisoned only if a thread panicked, which ends the training.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The derivatives by the learnable numbers, summed over the parts.
#[allow(clippy::cast_possible_truncation)] // training runs in f32
fn summed(structure: &Structure, networks: &[Network], parts: &[Mutex<Part>]) -> Vec<f32> {
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
    let parameters = structure.parameters().iter().map(|p| match p.fixed {
        true => 0.0,
        false => (free.next().expect("one number for each free parameter") * p.scale) as f32,
    });
    let mut sums: Vec<f32> = parameters.collect();
    for (network, by_network) in networks.iter().zip(&first.by_networks) {
        network.append_by_input(by_network, &mut sums);
    }
    sums
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::Evaluation;
    use crate::Backend;
    use crate::fused::problem::{Problem, RECORD_LIMIT};
    use crate::hybrid::to_f32;
    use crate::tests::{hybrid, transitions};
    use residyn_core::model::LastLayer;
    use residyn_core::sim::Integrator;

    #[test]
    fn repeating_the_forward_sweep_gives_the_same_bits_as_keeping_its_record() {
        let segments = transitions(1000, -0.5, 1);
        let model = hybrid((8.0, 2.0), &segments, Backend::NdArray, LastLayer::Random);
        let blocks = Arc::new(segments.blocks(&(0..segments.len()).collect::<Vec<_>>()));
        let derivative = |record_limit| {
            let precision = [1.0; 2].into();
            let problem = Problem::new(model.structure(), &blocks, Integrator::RK4, &precision);
            let problem = Problem {
                record_limit,
                ..problem
            };
            let numbers = to_f32(model.flat());
            let evaluation = Evaluation::new(Arc::new(problem), Arc::default(), &numbers);
            (evaluation.loss, evaluation.derivative([1.0, 0.3]))
        };
        assert_eq!(derivative(0), derivative(RECORD_LIMIT));
    }
}
