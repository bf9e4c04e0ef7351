use std::sync::Arc;

use burn::tensor::{Bool, Device, Tensor};

use super::tensor::{rows_of, tensor, to_f64, vector_of_f32};
use super::{HybridModel, Structure, Unpacked, equations};
use crate::model::{MlpWeights, Parameter};

/// Independent models of one structure, evaluated together by one operation on a device.
#[derive(Debug, Clone)]
pub(in crate::train) struct Stack {
    structure: Arc<Structure>,
    models: usize,
    /// The learnable numbers of the prior and of the residual, `[models, numbers]` each; none where there are no numbers.
    tensors: [Option<Tensor<2>>; 2],
    /// The lowest and the highest value / scale of each physical parameter, `[1, parameters]`; none without bounds.
    bounds: Option<[Tensor<2>; 2]>,
}

impl Stack {
    /// Copies of `model`, each with a network of its own in place of the model's: of its residual or, where it has none,
    /// of its prior.
    ///
    /// # Panics
    /// When there are no networks, or not of the shape of the model's own.
    pub(in crate::train) fn new(model: &HybridModel, networks: &[MlpWeights]) -> Self {
        let (structure, device) = (model.structure().clone(), model.device());
        let made = structure.networks.last().map(MlpWeights::widths);
        let fits = |network: &MlpWeights| Some(network.widths()) == made;
        assert!(
            !networks.is_empty() && networks.iter().all(fits),
            "networks are of the shape of the model's"
        );
        let models = networks.len();
        let flat: Vec<f64> = networks.iter().flat_map(MlpWeights::flat).collect();
        let width = flat.len() / models;
        let drawn = tensor(&flat, [models, width], &device);
        let tensors = if structure.has_residual {
            let prior = vector_of_f32(&model.numbers()[0], &device);
            [rows_of(prior, models), Some(drawn)]
        } else {
            [Some(drawn), None]
        };
        Self {
            bounds: bounds(structure.parameters(), &device),
            tensors: tensors.map(|tensor| tensor.map(Tensor::require_grad)),
            models,
            structure,
        }
    }

    /// Number of models.
    pub(in crate::train) fn models(&self) -> usize {
        self.models
    }

    /// The models without their learnable numbers.
    pub(in crate::train) fn structure(&self) -> &Structure {
        &self.structure
    }

    pub(in crate::train) fn device(&self) -> Device {
        let mut tensors = self.tensors.iter().flatten();
        tensors.next().expect("a network has numbers").device()
    }

    /// The learnable numbers of the prior and of the residual, `[models, numbers]` each.
    pub(in crate::train) fn tensors(&self) -> [Option<Tensor<2>>; 2] {
        self.tensors.clone()
    }

    /// Unpack the parameters for evaluations at so many rows for each model, one model's after the other's.
    pub(in crate::train) fn unpack(&self, rows: usize) -> Unpacked<'_> {
        Unpacked::new(&self.structure, rows, self.tensors())
    }

    /// The models that are `alive` (`[models]`) with other learnable numbers, physical parameters brought back within
    /// their bounds; the others as they are.
    pub(in crate::train) fn stepped(
        &self,
        tensors: [Option<Tensor<2>>; 2],
        alive: &Tensor<1, Bool>,
    ) -> Self {
        let alive: Tensor<2, Bool> = alive.clone().unsqueeze_dim(1);
        let [prior, residual] = tensors.map(|tensor| tensor.map(Tensor::inner));
        let mut stepped = [prior.map(|prior| self.project(prior)), residual];
        for (stepped, before) in stepped.iter_mut().zip(self.tensors()) {
            if let (Some(numbers), Some(before)) = (stepped.take(), before) {
                let alive = alive.clone().expand(numbers.dims());
                let numbers = before.inner().mask_where(alive, numbers);
                *stepped = Some(Tensor::from_inner(numbers).require_grad());
            }
        }
        Self {
            tensors: stepped,
            ..self.clone()
        }
    }

    /// Comparisons rather than minimum and maximum: what is not a number must stay so.
    fn project(&self, prior: Tensor<2>) -> Tensor<2> {
        let Some([lowest, highest]) = &self.bounds else {
            return prior;
        };
        let [lowest, highest] = [lowest, highest].map(|b| b.clone().expand(prior.dims()));
        let prior = (prior.clone()).mask_where(prior.lower(lowest.clone()), lowest);
        (prior.clone()).mask_where(prior.greater(highest.clone()), highest)
    }

    /// Values of the physical parameters of each model, in their units.
    pub(in crate::train) fn parameters(&self) -> Vec<Vec<f64>> {
        let declared = self.structure.parameters();
        if declared.is_empty() {
            return vec![Vec::new(); self.models];
        }
        let [prior, _] = self.tensors();
        let scaled = to_f64(prior.expect("declared parameters have values"));
        (scaled.chunks(declared.len()))
            .map(|scaled| equations::values(declared, scaled).collect())
            .collect()
    }
}

fn bounds(parameters: &[Parameter], device: &Device) -> Option<[Tensor<2>; 2]> {
    let bounded = |p: &Parameter| p.bounds.iter().any(|bound| bound.is_finite());
    let plain = device.clone().without_autodiff();
    let bound = |end: usize| {
        let values: Vec<f64> = parameters.iter().map(|p| p.bounds[end] / p.scale).collect();
        tensor(&values, [1, values.len()], &plain)
    };
    parameters.iter().any(bounded).then(|| [bound(0), bound(1)])
}
