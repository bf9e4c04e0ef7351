//! The fused loss as an operation of Burn's graph.

// `train::Backend` explains the choice of backend.
#![allow(deprecated)]

use std::sync::{Arc, Mutex};

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ndarray::NdArrayTensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, NdArray, backend_extension};
use burn::tensor::{Shape, Tensor};

use super::evaluation::{Evaluation, Workers};
use super::problem::Problem;
use crate::hybrid::{numbers_of, primitive};

/// Weighted sums of E and ||F_r||, one for each pair of weights, as a tensor `[sums]`; and the two alone. `numbers` are
/// the learnable numbers in the order of [`HybridModel::flat`](crate::HybridModel::flat).
pub(crate) fn loss(
    numbers: Tensor<1>,
    problem: Problem,
    workers: Arc<Workers>,
    sums: &[[f32; 2]],
) -> (Tensor<1>, [f64; 2]) {
    let parts = Arc::new(Mutex::new([0.0; 2]));
    let task = LossTask {
        problem: Arc::new(problem),
        workers,
        sums: sums.to_vec(),
        parts: parts.clone(),
    };
    let loss = <Dispatch as LossOperation>::fused_loss(numbers.into_dispatch(), task);
    let parts = *parts.lock().expect("no other thread uses it");
    (Tensor::from_dispatch(loss), parts)
}

/// Everything in the operation but the learnable numbers.
#[derive(Debug, Clone)]
struct LossTask {
    problem: Arc<Problem>,
    workers: Arc<Workers>,
    sums: Vec<[f32; 2]>,
    /// Receives E and ||F_r||.
    parts: Arc<Mutex<[f64; 2]>>,
}

impl LossTask {
    fn evaluate(self, numbers: &NdArrayTensor) -> (Evaluated, NdArrayTensor) {
        let evaluation = Evaluation::new(self.problem, self.workers, &numbers_of(numbers));
        let loss = evaluation.loss;
        *self.parts.lock().expect("no other thread uses it") = loss.map(f64::from);
        // A part with zero weight does not count, even if infinite.
        let weighted = |(weight, part): (&f32, f32)| match *weight {
            0.0 => 0.0,
            weight => weight * part,
        };
        let sums = (self.sums.iter()).map(|weights| weights.iter().zip(loss).map(weighted).sum());
        let loss = vector(sums.collect());
        let evaluated = Evaluated {
            evaluation: Arc::new(Mutex::new(evaluation)),
            sums: self.sums,
        };
        (evaluated, loss)
    }
}

/// What the derivative needs.
// Burn requires a state that can be cloned; it is used once.
#[derive(Debug, Clone)]
struct Evaluated {
    evaluation: Arc<Mutex<Evaluation>>,
    sums: Vec<[f32; 2]>,
}

/// The operation as backends know it.
#[backend_extension(NdArray, Autodiff)]
trait LossOperation: Backend {
    fn fused_loss(numbers: FloatTensor<Self>, task: LossTask) -> FloatTensor<Self>;
}

impl LossOperation for NdArray {
    fn fused_loss(numbers: NdArrayTensor, task: LossTask) -> NdArrayTensor {
        task.evaluate(&numbers).1
    }
}

impl<C: CheckpointStrategy> LossOperation for Autodiff<NdArray, C> {
    fn fused_loss(numbers: FloatTensor<Self>, task: LossTask) -> FloatTensor<Self> {
        let (evaluated, loss) = task.evaluate(numbers.primitive());
        let operation = LossBackward.prepare::<C>([numbers.node()]);
        match operation.compute_bound().stateful() {
            OpsKind::Tracked(operation) => operation.finish(evaluated, loss),
            OpsKind::UnTracked(operation) => operation.finish(loss),
        }
    }
}

#[derive(Debug)]
struct LossBackward;

impl Backward<NdArray, 1> for LossBackward {
    type State = Evaluated;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let by_sums = gradients.consume::<NdArray>(&ops.node);
        let mut by_loss = [0.0; 2];
        for (by_sum, weights) in numbers_of(&by_sums).iter().zip(&ops.state.sums) {
            for (by, weight) in by_loss.iter_mut().zip(weights) {
                *by += by_sum * weight;
            }
        }
        let evaluation = ops
            .state
            .evaluation
            .lock()
            .expect("no other thread uses it");
        if let [Some(numbers)] = ops.parents {
            gradients.register::<NdArray>(numbers.id, vector(evaluation.derivative(by_loss)));
        }
    }
}

fn vector(numbers: Vec<f32>) -> NdArrayTensor {
    let count = numbers.len();
    primitive(numbers, Shape::from([count]))
}
