//! Stage 7: estimate the chosen model in fine steps.

use super::fitted::Fitted;
use super::settings::RefineSettings;
use super::study::Study;
use crate::identify::{FitError, Shooting, uncertainty};
use crate::model::Model;

/// The chosen model, estimated in fine steps.
pub(super) struct Refined<'a> {
    /// The training logs in fine steps.
    pub study: Study<'a>,
    /// With 95 % intervals.
    pub model: Fitted,
    /// Why the model is the chosen one as it was, if the estimate failed.
    pub failure: Option<FitError>,
}

/// Estimate the chosen model in fine steps.
pub(super) fn refine<'a>(study: &Study<'a>, chosen: &Fitted) -> Refined<'a> {
    let fine = study.refined();
    let (study, mut model, failure) = match fine.estimate(chosen) {
        Ok(model) => (fine, model, None),
        Err(error) => (study.again(), chosen.clone(), Some(error)),
    };
    model.model = with_intervals(&study, &model, chosen);
    Refined {
        study,
        model,
        failure,
    }
}

impl Study<'_> {
    /// The same study in finer steps, to estimate a model that has been chosen. A width of friction's reversal that
    /// the model file gives stays.
    pub fn refined(&self) -> Self {
        let RefineSettings { step_s, narrower } = self.settings.refine;
        let narrower = self.system.sign_width.as_ref().map_or(narrower, |_| 1.0);
        let sign_widths: Vec<f64> = self.sign_widths.iter().map(|w| narrower * w).collect();
        let windows = self.shooting.windows.clone();
        let shooting = Shooting::new(self.logs, windows, &self.shooting.noise);
        Self {
            sign_widths,
            shooting: shooting.in_steps_of(step_s),
            ..self.again()
        }
    }

    /// Estimate a chosen model anew, from the values that it has.
    ///
    /// # Errors
    /// As [`Study::refit`].
    pub fn estimate(&self, chosen: &Fitted) -> Result<Fitted, FitError> {
        let locals = chosen.fit.locals.clone();
        self.refit(chosen, locals, None)
    }
}

/// A fitted model with its 95 % intervals; parameters that were not free have none. An interval reaches as much further
/// as the value was off in `coarse` numbers: smoothing and steps err to first order, so that what halving them changes is
/// what is left of their error (Richardson 1911).
pub(super) fn with_intervals(study: &Study<'_>, fitted: &Fitted, coarse: &Model) -> Model {
    let uncertainty = uncertainty(&study.shooting, &fitted.fit);
    let (values, coarse) = (fitted.values(), coarse.values());
    let mut model = fitted.model.clone();
    for (i, column) in fitted.fit.columns.iter().enumerate() {
        let k = column.parameter;
        let log = column.log.map(|log| &study.logs[log]);
        let off = match log {
            Some(_) => 0.0,
            None => (values[k] - coarse[k]).abs(),
        };
        model.set_half_width(k, log, uncertainty.half_width(i) + off);
    }
    model
}
