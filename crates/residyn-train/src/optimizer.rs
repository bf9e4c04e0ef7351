//! Burn's optimisers and learning-rate schedulers as a recipe names them.

use burn::lr_scheduler::cosine::CosineAnnealingLrSchedulerConfig;
use burn::lr_scheduler::exponential::ExponentialLrSchedulerConfig;
use burn::lr_scheduler::linear::LinearLrSchedulerConfig;
use burn::lr_scheduler::module_lr_scheduler::{ModuleLearningRate, ModuleLrScheduler};
use burn::module::ParamGroup;
use burn::optim::{
    AdaGradConfig, AdamConfig, AdamWConfig, AdanConfig, GradientsParams, LambConfig, LionConfig,
    ModuleOptimizer, RmsPropConfig, SgdConfig,
};
use burn::tensor::Gradients;
use serde::{Deserialize, Serialize};

use super::packed::Packed;
use super::without_subnormals::WithoutSubnormals;
use super::{FitSettings, HybridModel, TrainError, optimizer_record};

// PyTorch's value. Burn's default of 1e-5 is as large as gradients near the optimum of these losses, and would stop Adam
// short of it.
const EPSILON: f32 = 1e-8;

/// One of Burn's optimisers, with Burn's defaults except for Adam's epsilon, 1e-8.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OptimizerKind {
    /// Adam or, with weight decay, AdamW.
    #[default]
    Adam,
    AdaGrad,
    Adan,
    Lamb,
    Lion,
    RmsProp,
    Sgd,
}

/// How the learning rates fall from one epoch to the next; each is one of Burn's schedulers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Schedule {
    /// By the same factor in each epoch.
    #[default]
    Exponential,
    /// Along half a period of a cosine.
    Cosine,
    /// By the same amount in each epoch.
    Linear,
}

/// Gives weights of an optimiser's group weight decay, by this share of the learning rate.
type Decay = fn(ModuleOptimizer, ParamGroup, f32) -> ModuleOptimizer;

impl OptimizerKind {
    /// Every optimiser.
    pub const ALL: [Self; 7] = [
        Self::Adam,
        Self::AdaGrad,
        Self::Adan,
        Self::Lamb,
        Self::Lion,
        Self::RmsProp,
        Self::Sgd,
    ];

    /// The optimiser without weight decay and, if it has a decoupled one, what adds it.
    fn with_decay(self) -> (ModuleOptimizer, Option<Decay>) {
        match self {
            Self::Adam => (
                adam().into(),
                Some(|plain, group, decay| plain.with_group(group, adam_w(decay), None)),
            ),
            Self::AdaGrad => (AdaGradConfig::new().init(), None),
            Self::Adan => (
                AdanConfig::new().init(),
                Some(|plain, group, decay| {
                    let adan = AdanConfig::new().with_weight_decay(decay).build();
                    plain.with_group(group, adan, None)
                }),
            ),
            Self::Lamb => (
                LambConfig::new().init(),
                Some(|plain, group, decay| {
                    let lamb = LambConfig::new().with_weight_decay(decay).build();
                    plain.with_group(group, lamb, None)
                }),
            ),
            Self::Lion => (
                LionConfig::new().init(),
                Some(|plain, group, decay| {
                    let lion = LionConfig::new().with_weight_decay(decay).build();
                    plain.with_group(group, lion, None)
                }),
            ),
            Self::RmsProp => (RmsPropConfig::new().init(), None),
            Self::Sgd => (SgdConfig::new().init(), None),
        }
    }

    /// The optimiser without weight decay.
    fn plain(self) -> ModuleOptimizer {
        self.with_decay().0
    }

    /// The optimiser, with weights in `group` that decay by this share of the learning rate.
    fn decaying(self, group: ParamGroup, decay: f32) -> Result<ModuleOptimizer, TrainError> {
        match self.with_decay() {
            (plain, Some(add)) => Ok(add(plain, group, decay)),
            (_, None) => Err(TrainError::Decay(self)),
        }
    }

    /// The optimisers with decoupled weight decay, as a recipe names them, with commas between.
    pub(super) fn that_decay() -> String {
        let decay = |kind: &Self| kind.with_decay().1.is_some();
        let names = Self::ALL.into_iter().filter(decay).map(Self::name);
        names.collect::<Vec<_>>().join(", ")
    }

    /// As a recipe names it.
    pub(super) fn name(self) -> String {
        let name = serde_json::to_value(self).expect("a variant is a text");
        name.as_str().expect("a variant is a text").to_owned()
    }
}

fn adam() -> WithoutSubnormals<burn::optim::Adam> {
    WithoutSubnormals(AdamConfig::new().with_epsilon(EPSILON).build())
}

fn adam_w(decay: f32) -> WithoutSubnormals<burn::optim::AdamW> {
    let config = AdamWConfig::new().with_epsilon(EPSILON);
    WithoutSubnormals(config.with_weight_decay(decay).build())
}

impl Schedule {
    /// A scheduler from 1 in the first epoch to `last` in the last of `epochs`.
    fn scheduler(self, last: f64, epochs: usize) -> ModuleLrScheduler {
        let steps = epochs.saturating_sub(1).max(1);
        let scheduler = match self {
            Self::Exponential => {
                let factor = last.powf(1.0 / steps as f64);
                ExponentialLrSchedulerConfig::new(1.0, factor).init()
            }
            Self::Cosine => {
                let config = CosineAnnealingLrSchedulerConfig::new(1.0, steps);
                config.with_min_lr(last).init()
            }
            Self::Linear => LinearLrSchedulerConfig::new(1.0, last, steps).init(),
        };
        scheduler.expect("a share above 0 and at most 1, and steps")
    }
}

/// An optimiser for the parts of a model, each with its own learning rate.
#[derive(Clone)]
pub(super) struct Optimizer {
    optimizer: ModuleOptimizer,
    /// The factor on the learning rates.
    share: ModuleLrScheduler,
    /// The learning rate of the prior or of all parts, and the residual's with its tensor.
    prior: f64,
    residual: (ParamGroup, f64),
    /// The rates of the current epoch.
    rates: ModuleLearningRate,
}

impl Optimizer {
    /// # Errors
    /// Weight decay that the optimiser does not have.
    pub(super) fn new(
        model: &HybridModel,
        numbers: &Packed,
        settings: &FitSettings,
    ) -> Result<Self, TrainError> {
        let residual = ParamGroup::ids_from_module(numbers.residual.clone());
        let [prior, of_residual] = settings.learning_rates.of(model);
        #[allow(clippy::cast_possible_truncation)] // training runs in f32
        let decay = settings.weight_decay as f32;
        Ok(Self {
            optimizer: match (decay > 0.0, &model.residual, &model.prior) {
                // A prior below a residual was trained before and must not decay.
                (true, Some(_), _) => settings.optimizer.decaying(residual.clone(), decay)?,
                (true, None, Some(_)) => settings.optimizer.decaying(ParamGroup::all(), decay)?,
                _ => settings.optimizer.plain(),
            },
            share: settings
                .schedule
                .scheduler(settings.anneal, settings.epochs),
            prior,
            residual: (residual, of_residual),
            rates: ModuleLearningRate::default(),
        })
    }

    /// Sets the learning rates of the next epoch.
    pub(super) fn begin_epoch(&mut self) {
        let share = self.share.step().base();
        let (residual, rate) = self.residual.clone();
        let rates = ModuleLrScheduler::new(self.prior * share);
        self.rates = rates.with_group(residual, rate * share).step();
    }

    /// The numbers after a step against these gradients.
    pub(super) fn step(&mut self, numbers: Packed, gradients: Gradients) -> Packed {
        let gradients = GradientsParams::from_grads(gradients, &numbers);
        self.optimizer.step(self.rates.clone(), numbers, gradients)
    }

    /// Its state, as the bytes of a file.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        optimizer_record::to_bytes(&self.optimizer)
    }

    /// The optimiser after this many epochs of a run with these numbers, with its state at that time.
    ///
    /// # Errors
    /// What is wrong with bytes that are not such a record.
    pub(super) fn resumed(
        mut self,
        bytes: &[u8],
        numbers: &Packed,
        epochs: usize,
    ) -> Result<Self, String> {
        self.optimizer = optimizer_record::from_bytes(self.optimizer, bytes, numbers)?;
        (0..epochs).for_each(|_| self.begin_epoch());
        Ok(self)
    }
}
