use burn::module::{Module, ModuleMapper, Param, ParamId};
use burn::tensor::Tensor;

use super::hybrid::{join, within_bounds};
use super::{FitSettings, HybridModel};

/// The learnable numbers of a model in one tensor for each learning rate. A step of Adam takes thirteen Burn operations
/// per tensor, and running these on every layer of a small network would cost more than its loss.
#[derive(Module, Debug)]
pub(super) struct Packed {
    /// All numbers, or only the prior's, in the order of [`HybridModel::flat`].
    pub first: Param<Tensor<1>>,
    /// The residual's numbers, if it is trained differently from the prior.
    pub residual: Option<Param<Tensor<1>>>,
}

impl Packed {
    /// The numbers of a model on a device with gradients, for a run with these settings.
    pub(super) fn of(model: &HybridModel, settings: &FitSettings) -> Self {
        let [prior, residual] = settings.learning_rates.of(model);
        let alike = prior == residual && settings.weight_decay == 0.0;
        let parts = match &model.residual {
            Some(_) if !alike => model.flat_parts(),
            _ => (model.flat(), None),
        };
        Self {
            first: learnable(1, parts.0, prior),
            residual: parts.1.map(|flat| learnable(2, flat, residual)),
        }
    }

    /// All numbers in the order of [`HybridModel::flat`]: gradients run through them.
    pub(super) fn flat(&self) -> Tensor<1> {
        match &self.residual {
            Some(residual) => join(&[self.first.val(), residual.val()]),
            None => self.first.val(),
        }
    }

    /// `like` with these numbers, views of them: gradients run through it.
    pub(super) fn viewed(&self, like: &HybridModel) -> HybridModel {
        like.with_flat(&self.flat())
    }

    /// `like` with these numbers, as an independent model.
    pub(super) fn unpacked(&self, like: &HybridModel) -> HybridModel {
        self.viewed(like).map(&mut Leaves)
    }

    /// The same numbers with the physical parameters of `model` clamped to their bounds.
    pub(super) fn within_bounds(self, model: &HybridModel) -> Self {
        Self {
            first: within_bounds(model.structure().parameters(), self.first),
            ..self
        }
    }
}

/// Numbers with a rate of zero take no gradient.
fn learnable(id: u64, numbers: Tensor<1>, rate: f64) -> Param<Tensor<1>> {
    let param = Param::initialized(ParamId::from(id), leaf(numbers));
    param.set_require_grad(rate > 0.0)
}

/// The same entries, detached from the operations that computed them.
fn leaf<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    Tensor::from_inner(tensor.inner()).require_grad()
}

/// Turns every tensor of a module into one that depends on nothing.
struct Leaves;

impl ModuleMapper for Leaves {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, tensor, _) = param.consume();
        Param::initialized(id, leaf(tensor))
    }
}
