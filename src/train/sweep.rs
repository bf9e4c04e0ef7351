//! One recipe's model trained many times, from other networks or with other penalties.

use std::ops::ControlFlow;

use super::stacked::StackedSweep;
use super::{
    Backend, FitSettings, HybridModel, Segments, SweepProgress, TrainError, Trained, Training,
    Variant,
};
use crate::model::MlpWeights;

/// A run of many models of one structure.
///
/// On the processor one model is trained after the other, each by the fused loss on all cores. On other devices, which
/// one model leaves idle, all are trained as one batch.
#[derive(Debug, Clone)]
pub struct Sweep {
    model: HybridModel,
    settings: FitSettings,
    variants: Vec<Variant>,
}

impl Sweep {
    /// A run that has not begun: copies of `model`, one for each variant. The model must be on a device
    /// with gradients and have a network.
    ///
    /// # Errors
    /// Settings that are out of range.
    ///
    /// # Panics
    /// When there are no variants, or with networks that are not of the shape of the model's own.
    pub fn new(
        model: &HybridModel,
        settings: FitSettings,
        variants: Vec<Variant>,
    ) -> Result<Self, TrainError> {
        settings.check()?;
        let made = model.structure().networks.last().map(MlpWeights::widths);
        let fits = |variant: &Variant| Some(variant.network.widths()) == made;
        assert!(
            !variants.is_empty() && variants.iter().all(fits),
            "networks are of the shape of the model's"
        );
        Ok(Self {
            model: model.clone(),
            settings,
            variants,
        })
    }

    /// How often the observer of a run is called.
    pub fn rounds(&self) -> usize {
        match self.is_stacked() {
            true => self.settings.epochs,
            false => self.variants.len() * self.settings.epochs,
        }
    }

    fn is_stacked(&self) -> bool {
        self.model.device() != Backend::NdArray.device()
    }

    /// Trains every model to its last epoch; `observer` is called after each epoch of all models or, on the processor, of
    /// one.
    ///
    /// # Errors
    /// Segments that do not fit the model.
    pub fn run(
        &self,
        segments: &Segments,
        observer: &mut dyn FnMut(SweepProgress),
    ) -> Result<Vec<Trained>, TrainError> {
        if self.is_stacked() {
            let variants = self.variants.clone();
            return StackedSweep::new(&self.model, self.settings.clone(), variants)?
                .run(segments, observer);
        }
        let mut trained: Vec<Trained> = Vec::new();
        for variant in &self.variants {
            let diverged = trained.iter().filter(|model| model.diverged).count();
            let mut after_epoch = || observer(SweepProgress { diverged });
            trained.push(self.alone(variant, segments, &mut after_epoch)?);
        }
        Ok(trained)
    }

    fn alone(
        &self,
        variant: &Variant,
        segments: &Segments,
        after_epoch: &mut dyn FnMut(),
    ) -> Result<Trained, TrainError> {
        let mut run = self.training(variant)?;
        let ended = run.run(segments, None, &mut |_| {
            after_epoch();
            ControlFlow::Continue(())
        });
        match ended {
            Ok(_) => Ok(Trained::of(&run)),
            Err(TrainError::Diverged { .. }) => Ok(Trained {
                error: f64::NAN,
                residual_norm: f64::NAN,
                parameters: run.model().weights().parameters,
                diverged: true,
            }),
            Err(error) => Err(error),
        }
    }

    /// The run of one variant alone.
    pub(super) fn training(&self, variant: &Variant) -> Result<Training, TrainError> {
        let mut weights = self.model.weights();
        match &mut weights.residual {
            Some(residual) => *residual = variant.network.clone(),
            None => weights.prior = Some(variant.network.clone()),
        }
        let settings = FitSettings {
            penalty: self.settings.penalty.from(variant.penalty_weight),
            ..self.settings.clone()
        };
        let model = self.model.with_weights(&weights)?;
        Training::new(model, settings, variant.order.clone())
    }
}
