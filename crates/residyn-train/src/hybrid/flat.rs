//! The learnable numbers of a model as one tensor, joined by one operation of Burn's graph: reshaping and concatenating
//! the tensors would take some forty, each slower than copying the numbers.

// `train::Backend` explains the choice of backend.
#![allow(deprecated)]

use std::borrow::Cow;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::{
    BalancedCheckpointing, CheckpointStrategy, NoCheckpointing,
};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, NodeGuard, Ops, OpsKind};
use burn::backend::ndarray::NdArrayTensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Autodiff, BackendTensor, DispatchAutodiffContext, DispatchKindConversion, DispatchTensor,
    GradientCheckpointingStrategy, NdArray, TensorMetadata,
};
use burn::tensor::{Shape, Tensor, TensorData};

/// Largest number of tensors that one operation joins: Burn's operations have a fixed number of inputs.
const MOST: usize = 20;

/// All entries of these tensors on the processor, tensor after tensor and row after row, with their derivatives.
///
/// # Panics
/// Without tensors, or if some belong to another backend.
pub(super) fn flattened(mut parts: Vec<DispatchTensor>) -> Tensor<1> {
    assert!(!parts.is_empty(), "there is something to flatten");
    loop {
        let mut rest = parts.into_iter().peekable();
        parts = Vec::new();
        while rest.peek().is_some() {
            parts.push(joined(rest.by_ref().take(MOST).collect()));
        }
        if parts.len() == 1 {
            return Tensor::from_dispatch(parts.remove(0));
        }
    }
}

/// [`flattened`] for vectors.
pub(crate) fn join(parts: &[Tensor<1>]) -> Tensor<1> {
    let parts = parts.iter().cloned();
    flattened(parts.map(Tensor::into_dispatch).collect())
}

fn joined(parts: Vec<DispatchTensor>) -> DispatchTensor {
    use GradientCheckpointingStrategy::{Balanced, Disabled};
    match parts[0].autodiff {
        DispatchAutodiffContext::Disabled => {
            let parts: Vec<NdArrayTensor> = primitives::<NdArray>(parts);
            dispatched::<NdArray>(concatenated(&parts))
        }
        DispatchAutodiffContext::Enabled(Disabled) => recorded::<NoCheckpointing>(parts),
        DispatchAutodiffContext::Enabled(Balanced) => recorded::<BalancedCheckpointing>(parts),
    }
}

fn primitives<B: burn::backend::Backend>(parts: Vec<DispatchTensor>) -> Vec<FloatTensor<B>>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    let of_backend = |part| match DispatchTensor::try_into_backend(part) {
        Ok(BackendTensor::Float(primitive)) => primitive,
        other => panic!("a model's tensors are of one backend: {:?}", other.err()),
    };
    parts.into_iter().map(of_backend).collect()
}

fn dispatched<B: burn::backend::Backend>(primitive: FloatTensor<B>) -> DispatchTensor
where
    DispatchTensor: DispatchKindConversion<B>,
{
    DispatchTensor::from_backend(BackendTensor::<B>::Float(primitive))
}

/// The joined tensor, recorded so that its derivative can be split into parts again.
fn recorded<C: CheckpointStrategy>(parts: Vec<DispatchTensor>) -> DispatchTensor
where
    DispatchTensor: DispatchKindConversion<Autodiff<NdArray, C>>,
{
    let parts = primitives::<Autodiff<NdArray, C>>(parts);
    macro_rules! of_count {
        ($($count:literal)*) => {
            match parts.len() {
                $($count => record::<C, $count>(parts),)*
                count => unreachable!("{count} tensors are joined at once"),
            }
        };
    }
    let joined = of_count!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20);
    dispatched::<Autodiff<NdArray, C>>(joined)
}

fn record<C: CheckpointStrategy, const N: usize>(
    parts: Vec<FloatTensor<Autodiff<NdArray, C>>>,
) -> FloatTensor<Autodiff<NdArray, C>> {
    let (primitives, nodes): (Vec<NdArrayTensor>, Vec<NodeGuard>) =
        parts.into_iter().map(|part| part.into_parts()).unzip();
    let joined = concatenated(&primitives);
    let shapes = primitives.iter().map(TensorMetadata::shape).collect();
    let nodes: [NodeGuard; N] = nodes.try_into().expect("as many nodes as tensors");
    match Join.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(operation) => operation.finish(shapes, joined),
        OpsKind::UnTracked(operation) => operation.finish(joined),
    }
}

#[derive(Debug)]
struct Join;

impl<const N: usize> Backward<NdArray, N> for Join {
    /// The shapes of the parts.
    type State = Vec<Shape>;

    fn backward(
        self,
        ops: Ops<Self::State, N>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let gradient = gradients.consume::<NdArray>(&ops.node);
        let numbers = numbers_of(&gradient);
        let mut rest = &*numbers;
        for (parent, shape) in ops.parents.into_iter().zip(ops.state) {
            let (of_part, after) = rest.split_at(shape.num_elements());
            rest = after;
            if let Some(parent) = parent {
                gradients.register::<NdArray>(parent.id, primitive(of_part.to_vec(), shape));
            }
        }
    }
}

fn concatenated(parts: &[NdArrayTensor]) -> NdArrayTensor {
    let mut numbers = Vec::new();
    for part in parts {
        numbers.extend_from_slice(&numbers_of(part));
    }
    let count = numbers.len();
    primitive(numbers, Shape::from([count]))
}

/// The entries of a tensor of any layout, row after row.
pub(crate) fn numbers_of(tensor: &NdArrayTensor) -> Cow<'_, [f32]> {
    let NdArrayTensor::F32(storage) = tensor else {
        unreachable!("models are f32")
    };
    let view = storage.view();
    match view.to_slice() {
        Some(numbers) => Cow::Borrowed(numbers),
        None => Cow::Owned(view.iter().copied().collect()),
    }
}

/// A tensor of these entries.
pub(crate) fn primitive(numbers: Vec<f32>, shape: Shape) -> NdArrayTensor {
    NdArrayTensor::from_data(TensorData::new(numbers, shape))
}
