use std::ops::ControlFlow;

use serde::Serialize;

use super::{Job, Kind, Recipe, RecipeError};
use crate::{FitSettings, HybridModel, Penalty, TrainError, Trained, Training};
use residyn_core::model::MlpWeights;
use residyn_core::streams::{Purpose, stream};

/// What distinguishes one model of a sweep from the others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Member {
    /// Seed of its initial weights and of the order of its minibatches.
    pub seed: u64,
    /// Weight of the penalty; the recipe's if `None`.
    pub alpha: Option<f64>,
}

impl Job {
    /// Check that a sweep can train these models.
    ///
    /// # Errors
    /// A model without a network, whose copies would all be equal; alpha for a penalty that does not take it.
    pub fn check_members(&self, members: &[Member]) -> Result<(), RecipeError> {
        let Self { recipe, .. } = self;
        let with_alpha = members.iter().any(|member| member.alpha.is_some());
        let no_alpha = |reason| RecipeError::NoAlpha {
            path: recipe.path.clone(),
            reason,
        };
        match (recipe.kind, recipe.fit.penalty) {
            (Kind::Physics, _) => Err(recipe.wrong(
                "kind = \"physics\" has no network, so all models of a sweep would be the same; use kind = \
                 \"hybrid\", or train one model"
                    .into(),
            )),
            (Kind::DataDriven, _) if with_alpha => Err(no_alpha(
                "alpha weights the residual, but kind = \"data_driven\" has none; use kind = \"hybrid\"",
            )),
            (_, Penalty::Adaptive { .. }) if with_alpha => Err(no_alpha(
                "[fit] has the adaptive penalty, which finds its own weight; use penalty = \
                 { fixed = { alpha = 1e-4 } }",
            )),
            _ => Ok(()),
        }
    }

    /// Trains one model of a sweep on the data of this job, from the weights that a job with the model's seed would
    /// draw. `after_epoch` is called after each epoch.
    ///
    /// # Errors
    /// Settings that are out of range. A model that diverges is not an error.
    pub fn train_member(
        &self,
        member: &Member,
        after_epoch: &mut dyn FnMut(),
    ) -> Result<Trained, TrainError> {
        let fit = &self.recipe.fit;
        let settings = FitSettings {
            penalty: fit
                .penalty
                .from(member.alpha.unwrap_or(fit.penalty.initial())),
            ..fit.clone()
        };
        let order = stream(member.seed, Purpose::RecipeOrder);
        let mut run = Training::new(self.redrawn(member.seed)?, settings, order)?;
        let ended = run.run(&self.data.training, None, &mut |_| {
            after_epoch();
            ControlFlow::Continue(())
        });
        match ended {
            Ok(_) => Ok(Trained::of(&run)),
            Err(TrainError::Diverged { .. }) => Ok(Trained::diverged(&run.model())),
            Err(error) => Err(error),
        }
    }

    /// The job's model with the network that a job with another seed would draw.
    fn redrawn(&self, seed: u64) -> Result<HybridModel, TrainError> {
        let Recipe { kind, .. } = &self.recipe;
        let mut weights = self.model.weights();
        let network = weights.residual.as_mut().or(weights.prior.as_mut());
        let network: &mut MlpWeights = network.expect("models of a sweep have a network");
        let mut rng = stream(seed, Purpose::RecipeNetwork);
        *network = network.redrawn(kind.last_layer(), &mut rng);
        Ok(self.model.with_weights(&weights)?)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::recipe::{Job, Recipe};
    use crate::{Backend, HybridModel};
    use residyn_core::model::{Library, MlpWeights, ModelWeights};

    #[test]
    fn a_member_begins_with_the_weights_of_its_own_job() {
        let smoke = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/smoke");
        for name in ["train-acrobot.toml", "train-pendulum-offline.toml"] {
            let job = |seed| {
                let recipe = Recipe::read(&smoke.join(name)).unwrap();
                Job::train(recipe, &Library::built_in(), Backend::NdArray, seed).unwrap()
            };
            let (first, own) = (job(4), job(5));
            let network = |model: &HybridModel| -> MlpWeights {
                let ModelWeights {
                    prior, residual, ..
                } = model.weights();
                residual.or(prior).unwrap()
            };
            let redrawn = network(&first.redrawn(5).unwrap());
            assert_eq!(redrawn.layers, network(&own.model).layers);
            assert_ne!(redrawn.layers, network(&first.model).layers);
            assert_eq!(redrawn.scaling, network(&first.model).scaling);
        }
    }
}
