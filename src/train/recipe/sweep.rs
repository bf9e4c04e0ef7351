use serde::Serialize;

use super::{Job, Kind, Recipe, RecipeError};
use crate::model::MlpWeights;
use crate::runs::{Purpose, stream};
use crate::train::{Penalty, Sweep, Variant};

/// What sets one model of a sweep apart from the others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Member {
    /// Seed of its initial weights and of the order of its minibatches.
    pub seed: u64,
    /// Weight of the penalty; the recipe's own where there is none.
    pub alpha: Option<f64>,
}

impl Job {
    /// Trains many models at once, all on the data of this job. Each starts from the weights that a job of its own seed
    /// would draw.
    ///
    /// # Errors
    /// A model without a network, whose copies would all be equal; weights for a penalty that does not take them; settings
    /// out of range.
    ///
    /// # Panics
    /// If `members` is empty.
    pub fn sweep(&self, members: &[Member]) -> Result<Sweep, RecipeError> {
        self.check(members)?;
        let made = self.model.structure().networks.last();
        let made = made.expect("only models of equations alone have no network");
        let variants = members.iter().map(|member| self.variant(made, member));
        Ok(Sweep::new(
            &self.model,
            self.recipe.fit.clone(),
            variants.collect(),
        )?)
    }

    fn variant(&self, made: &MlpWeights, member: &Member) -> Variant {
        let Recipe { kind, fit, .. } = &self.recipe;
        let mut rng = stream(member.seed, Purpose::RecipeNetwork);
        Variant {
            network: made.redrawn(kind.last_layer(), &mut rng),
            penalty_weight: member.alpha.unwrap_or(fit.penalty.initial()),
            order: stream(member.seed, Purpose::RecipeOrder),
        }
    }

    fn check(&self, members: &[Member]) -> Result<(), RecipeError> {
        let Self { recipe, .. } = self;
        let with_alpha = members.iter().any(|member| member.alpha.is_some());
        let no_alpha = |reason| RecipeError::NoAlpha {
            path: recipe.path.clone(),
            reason,
        };
        match (recipe.kind, recipe.fit.penalty) {
            (Kind::Physics, _) => Err(recipe.wrong(
                "kind = \"physics\" has no network, so that all models of a sweep would be the same; take kind = \
                 \"hybrid\", or train one model"
                    .into(),
            )),
            (Kind::DataDriven, _) if with_alpha => Err(no_alpha(
                "alpha weighs the residual, and kind = \"data_driven\" has none; take kind = \"hybrid\"",
            )),
            (_, Penalty::Adaptive { .. }) if with_alpha => Err(no_alpha(
                "[fit] has the adaptive penalty, which finds its weight itself; take penalty = \
                 { fixed = { alpha = 1e-4 } }",
            )),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::Member;
    use crate::model::Library;
    use crate::train::Backend;
    use crate::train::recipe::{Job, Recipe};

    #[test]
    fn a_member_begins_with_the_weights_of_its_own_job() {
        let smoke = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/smoke");
        for name in ["train-acrobot.toml", "train-pendulum-offline.toml"] {
            let job = |seed| {
                let recipe = Recipe::read(&smoke.join(name)).unwrap();
                Job::train(recipe, &Library::built_in(), Backend::NdArray, seed).unwrap()
            };
            let (first, own) = (job(4), job(5));
            let network = |job: &Job| job.model.structure().networks.last().unwrap().clone();
            let (seed, alpha) = (5, None);
            let variant = first.variant(&network(&first), &Member { seed, alpha });
            assert_eq!(variant.network.layers, network(&own).layers);
            assert_ne!(variant.network.layers, network(&first).layers);
            assert_eq!(variant.network.scaling, network(&first).scaling);
        }
    }
}
