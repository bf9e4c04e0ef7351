// `train::Backend` says why this backend.
#![allow(deprecated)]

use std::borrow::Cow;
use std::sync::{Arc, Mutex};

use burn::backend::NdArray;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ndarray::NdArrayTensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::{Tensor, TensorData};

use super::evaluation::Evaluation;
use super::problem::{Problem, RECORD_LIMIT};
use super::{Blocks, Workers};
use crate::sim::Integrator;
use crate::train::HybridModel;

/// E and ||F_r||, `[2]`.
pub(in crate::train) fn loss(
    model: &HybridModel,
    blocks: &Arc<Blocks>,
    integrator: Integrator,
    precision: &Arc<[f32]>,
    workers: &Arc<Workers>,
) -> Tensor<1> {
    let none = || Tensor::zeros([0], &model.device());
    let [prior, residual] = model.tensors().map(|numbers| numbers.unwrap_or_else(none));
    let problem = Problem {
        structure: model.structure().clone(),
        blocks: blocks.clone(),
        integrator,
        precision: precision.clone(),
        record_limit: RECORD_LIMIT,
    };
    Tensor::from_dispatch(<Dispatch as LossOperation>::fused_loss(
        prior.into_dispatch(),
        residual.into_dispatch(),
        Arc::new(problem),
        workers.clone(),
    ))
}

/// The operation as backends know it.
#[backend_extension(NdArray, Autodiff)]
pub(super) trait LossOperation: Backend {
    fn fused_loss(
        prior: FloatTensor<Self>,
        residual: FloatTensor<Self>,
        problem: Arc<Problem>,
        workers: Arc<Workers>,
    ) -> FloatTensor<Self>;
}

impl LossOperation for NdArray {
    fn fused_loss(
        prior: NdArrayTensor,
        residual: NdArrayTensor,
        problem: Arc<Problem>,
        workers: Arc<Workers>,
    ) -> NdArrayTensor {
        vector(evaluate(&prior, &residual, problem, workers).loss.to_vec())
    }
}

impl<C: CheckpointStrategy> LossOperation for Autodiff<NdArray, C> {
    fn fused_loss(
        prior: FloatTensor<Self>,
        residual: FloatTensor<Self>,
        problem: Arc<Problem>,
        workers: Arc<Workers>,
    ) -> FloatTensor<Self> {
        let evaluation = evaluate(prior.primitive(), residual.primitive(), problem, workers);
        let loss = vector(evaluation.loss.to_vec());
        let preparation = LossBackward.prepare::<C>([prior.node(), residual.node()]);
        match preparation.compute_bound().stateful() {
            OpsKind::Tracked(preparation) => {
                preparation.finish(Arc::new(Mutex::new(evaluation)), loss)
            }
            OpsKind::UnTracked(preparation) => preparation.finish(loss),
        }
    }
}

#[derive(Debug)]
struct LossBackward;

impl Backward<NdArray, 2> for LossBackward {
    // Burn asks for a state that can be cloned; it is used once.
    type State = Arc<Mutex<Evaluation>>;

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let by_loss = gradients.consume::<NdArray>(&ops.node);
        let by_loss = (*numbers(&by_loss)).try_into();
        let by_loss = by_loss.expect("the loss is of two numbers");
        let evaluation = ops.state.lock().expect("no other thread uses it");
        for (parent, slopes) in ops.parents.into_iter().zip(evaluation.derivative(by_loss)) {
            // An input without numbers has no gradient.
            if let Some(parent) = parent.filter(|_| !slopes.is_empty()) {
                gradients.register::<NdArray>(parent.id, vector(slopes));
            }
        }
    }
}

fn evaluate(
    prior: &NdArrayTensor,
    residual: &NdArrayTensor,
    problem: Arc<Problem>,
    workers: Arc<Workers>,
) -> Evaluation {
    Evaluation::new(problem, workers, &numbers(prior), &numbers(residual))
}

/// The numbers of a tensor of any layout, in order.
fn numbers(tensor: &NdArrayTensor) -> Cow<'_, [f32]> {
    let NdArrayTensor::F32(storage) = tensor else {
        unreachable!("models are f32")
    };
    let view = storage.view();
    match view.to_slice() {
        Some(numbers) => Cow::Borrowed(numbers),
        None => Cow::Owned(view.iter().copied().collect()),
    }
}

fn vector(numbers: Vec<f32>) -> NdArrayTensor {
    let shape = [numbers.len()];
    NdArrayTensor::from_data(TensorData::new(numbers, shape))
}
