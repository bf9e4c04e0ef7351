use std::ops::ControlFlow;

use super::RunError;
use crate::control::{Purpose, stream};
use crate::model::{Dynamics, InputScaling, LastLayer, MlpSettings, MlpWeights};
use crate::train::{Backend, FitSettings, HybridModel, Segments, Training};

/// What a model knows before it has seen the plant.
#[derive(Debug, Clone)]
pub enum Prior {
    /// Nothing: the model is a network alone, from random numbers.
    Nothing,
    /// Equations, whose parameters go on learning.
    Equations(Box<Dynamics>),
    /// A trained model, which goes on learning where its learning rate lets it.
    Trained(Box<HybridModel>),
}

/// How a model comes of data.
#[derive(Debug, Clone)]
pub struct Learner {
    pub system: String,
    pub joints: usize,
    pub prior: Prior,
    /// The network that is added to the prior, or stands alone.
    pub network: MlpSettings,
    pub fit: FitSettings,
    pub backend: Backend,
}

impl Learner {
    /// The prior as a model; none where nothing is known.
    ///
    /// # Errors
    /// Equations with a parameter that cannot be learnt.
    pub fn untrained(&self) -> Result<Option<HybridModel>, RunError> {
        Ok(match &self.prior {
            Prior::Nothing => None,
            Prior::Equations(dynamics) => {
                Some(HybridModel::physics(dynamics, &self.backend.device())?)
            }
            // With tensors of its own: runs on several threads that share one can block each other for ever, since the
            // autodiff backend keeps what hangs together in one graph and takes its locks in either order.
            Prior::Trained(model) => Some(model.with_weights(&model.weights())?),
        })
    }

    /// Train on `segments`, from `previous` or else from the prior. The optimiser starts anew, and the network's
    /// features are scaled to the data at hand.
    ///
    /// # Errors
    /// Data of another system, or a loss that is no longer finite.
    pub fn learn(
        &self,
        segments: &Segments,
        previous: Option<&HybridModel>,
        seed: u64,
        round: usize,
    ) -> Result<Training, RunError> {
        let scaling = segments.scaling(self.network.angles);
        let model = match previous {
            Some(model) => self.rescaled(model, scaling)?,
            None => self.first(scaling, seed, round)?,
        };
        let order = stream(seed, Purpose::Order, round);
        let mut training = Training::new(model, self.fit.clone(), order)?;
        training.run(segments, None, &mut |_| ControlFlow::Continue(()))?;
        Ok(training)
    }

    fn first(
        &self,
        scaling: InputScaling,
        seed: u64,
        round: usize,
    ) -> Result<HybridModel, RunError> {
        let mut rng = stream(seed, Purpose::Network, round);
        let mut network =
            |last| MlpWeights::new(self.joints, &self.network, scaling.clone(), last, &mut rng);
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
