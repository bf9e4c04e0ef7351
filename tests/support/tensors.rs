//! Numbers as tensors and back.

use burn::tensor::{Device, Tensor, TensorData};

/// The devices that every build has, with gradients.
pub fn devices() -> Vec<Device> {
    vec![residyn_train::Backend::NdArray.device()]
}

pub fn tensor(values: &[f64], device: &Device) -> Tensor<1> {
    let values: Vec<f32> = values.iter().map(|x| *x as f32).collect();
    let rows = values.len();
    Tensor::from_data(TensorData::new(values, [rows]), device)
}

pub fn numbers(tensor: Tensor<1>) -> Vec<f64> {
    tensor.into_data().iter::<f32>().map(f64::from).collect()
}
