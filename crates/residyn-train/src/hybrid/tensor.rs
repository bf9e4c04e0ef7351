//! Numbers as tensors and back. Training runs in f32.

use burn::tensor::{Device, Tensor, TensorData};

use residyn_core::model;

pub(crate) fn vector(values: &[f64], device: &Device) -> Tensor<1> {
    tensor(values, [values.len()], device)
}

/// The values row after row.
pub(super) fn tensor<const D: usize>(
    values: &[f64],
    shape: [usize; D],
    device: &Device,
) -> Tensor<D> {
    Tensor::from_data(TensorData::new(model::to_f32(values), shape), device)
}

/// The entries of a tensor, row after row.
pub(crate) fn to_f32<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    let data = tensor.into_data();
    data.try_into_vec().expect("training runs in f32")
}

/// The same in f64.
pub(crate) fn to_f64<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    to_f32(tensor).into_iter().map(f64::from).collect()
}

/// The entries of a vector in turn, as views of it.
pub(super) struct Views<'a> {
    of: &'a Tensor<1>,
    taken: usize,
}

impl<'a> Views<'a> {
    pub(super) fn new(of: &'a Tensor<1>) -> Self {
        Self { of, taken: 0 }
    }

    /// The next `count` entries.
    ///
    /// # Panics
    /// If fewer are left.
    pub(super) fn next(&mut self, count: usize) -> Tensor<1> {
        let view = self.of.clone().narrow(0, self.taken, count);
        self.taken += count;
        view
    }
}

/// The columns of a matrix `[batch, width]`.
pub(super) fn columns(matrix: Tensor<2>) -> Vec<Tensor<1>> {
    let [batch, width] = matrix.dims();
    if width == 1 {
        return vec![matrix.reshape([batch])];
    }
    (0..width)
        .map(|k| matrix.clone().slice([0..batch, k..k + 1]).reshape([batch]))
        .collect()
}
