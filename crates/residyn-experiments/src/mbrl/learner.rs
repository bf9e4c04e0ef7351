use std::ops::ControlFlow;

use super::RunError;
use residyn_core::model::{Dynamics, InputScaling, LastLayer, MlpSettings, MlpWeights};
use residyn_core::streams::{Purpose, stream};
use residyn_train::{Backend, FitSettings, HybridModel, Segments, Training};

/// What a model starts from.
#[derive(Debug, Clone)]
pub enum Prior {
    /// Nothing: the model is a network with random initial weights.
    Nothing,
    /// Equations, whose parameters are trained.
    Equations(Box<Dynamics>),
    /// A trained model, which is trained further if its learning rate is not zero.
    Trained(Box<HybridModel>),
}

/// How models are trained on data.
#[derive(Debug, Clone)]
pub struct Learner {
    pub system: String,
    pub joints: usize,
    pub prior: Prior,
    /// The network that is added to the prior or, without a prior, is the whole model.
    pub network: MlpSettings,
    pub fit: FitSettings,
    pub backend: Backend,
}

impl Learner {
    /// The prior as a model, if there is one.
    ///
    /// # Errors
    /// Equations with a parameter that cannot be trained.
    pub fn untrained(&self) -> Result<Option<HybridModel>, RunError> {
        Ok(match &self.prior {
            Prior::Nothing => None,
            Prior::Equations(dynamics) => {
                Some(HybridModel::physics(dynamics, &self.backend.device())?)
            }
            // With its own tensors: threads that share a tensor can deadlock, since the autodiff backend keeps all
            // connected tensors in one graph and does not take its locks in a fixed order.
            Prior::Trained(model) => Some(model.with_weights(&model.weights())?),
        })
    }

    /// Trains on `segments`, starting from `previous` or else from the prior. The optimiser is reset, and the network's
    /// features are scaled to these data.
    ///
    /// # Errors
    /// Data of another system, or a loss that is not finite.
    pub fn learn(
        &self,
        segments: &Segments,
        previous: Option<&HybridModel>,
        seed: u64,
        round: usize,
    ) -> Result<Training, RunError> {
        let model = match previous {
            Some(model) => self.rescaled(model, segments.scaling(self.network.angles))?,
            None => self.first(segments, seed, round)?,
        };
        let order = stream(seed, Purpose::Order(round));
        let mut training = Training::new(model, self.fit.clone(), order)?;
        training.run(segments, None, &mut |_| ControlFlow::Continue(()))?;
        Ok(training)
    }

    fn first(&self, segments: &Segments, seed: u64, round: usize) -> Result<HybridModel, RunError> {
        let mut rng = stream(seed, Purpose::Network(round));
        let mut network = |last| segments.network(&self.network, last, &mut rng);
        match self.untrained()? {
            Some(prior) => Ok(prior.with_residual(&network(LastLayer::Zero))?),
            None => self.alone(&network(LastLayer::Random)),
        }
    }

    fn rescaled(
        &self,
        model: &HybridModel,
        scaling: InputScaling,
    ) -> Result<HybridModel, RunError> {
        let weights = model.weights();
        match (&weights.residual, &weights.prior) {
            (Some(residual), _) => Ok(model.clone().with_residual(&residual.rescaled(scaling))?),
            (None, Some(network)) => self.alone(&network.rescaled(scaling)),
            (None, None) => Ok(model.clone()),
        }
    }

    fn alone(&self, network: &MlpWeights) -> Result<HybridModel, RunError> {
        let device = self.backend.device();
        Ok(HybridModel::network(
            &self.system,
            self.joints,
            network,
            &device,
        )?)
    }
}
