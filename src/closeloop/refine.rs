//! Stage 7: estimate the chosen model in fine steps.

use super::fitted::Fitted;
use super::settings::RefineSettings;
use super::study::{Study, smooth};
use crate::identify::{FitError, Shooting, uncertainty};
use crate::model::Parameter;

/// The chosen model, estimated in fine steps.
pub(super) struct Refined<'a> {
    /// The training logs in fine steps.
    pub study: Study<'a>,
    pub model: Fitted,
    /// All parameters of the model, with their 95 % intervals.
    pub parameters: Vec<Parameter>,
    /// Why the model is the chosen one as it was, if the estimate failed.
    pub failure: Option<FitError>,
}

/// Estimate the chosen model in fine steps.
pub(super) fn refine<'a>(study: &Study<'a>, chosen: &Fitted) -> Refined<'a> {
    let fine = study.refined();
    let (study, model, failure) = match fine.estimate(chosen) {
        Ok(model) => (fine, model, None),
        Err(error) => (study.again(), chosen.clone(), Some(error)),
    };
    Refined {
        parameters: with_intervals(&study, &model, &chosen.fit.values),
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
            sign: smooth(&sign_widths),
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
        self.refit(&chosen.effects, &chosen.declared, locals, None)
    }
}

/// Fitted values with their 95 % intervals; parameters that were not free have none. An interval reaches as much
/// further as the value was off in coarser numbers: smoothing and steps err to first order, so that what halving
/// them changes is what is left of their error (Richardson 1911).
pub(super) fn with_intervals(study: &Study<'_>, model: &Fitted, coarse: &[f64]) -> Vec<Parameter> {
    let uncertainty = uncertainty(&study.shooting, &model.fit);
    let mut parameters = model.dynamics.parameters.clone();
    for (parameter, value) in parameters.iter_mut().zip(&model.fit.values) {
        parameter.value = *value;
        parameter.ci95 = None;
    }
    for (i, column) in model.fit.columns.iter().enumerate() {
        let k = column.parameter;
        if column.log.is_some() {
            continue;
        }
        let value = model.fit.values[k];
        let half = uncertainty.half_width(i) + (value - coarse[k]).abs();
        let [low, high] = parameters[k].bounds;
        parameters[k].ci95 = Some([(value - half).max(low), (value + half).min(high)]);
    }
    for (e, effect) in model.effects.iter().enumerate() {
        if let Some(k) = effect.shifted() {
            parameters[k] = parameters[k].shifted_by(&parameters[model.range_of(e).start]);
        }
    }
    parameters
}
