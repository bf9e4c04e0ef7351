//! Stage 7: estimate the chosen model in fine steps.

use super::fitted::Fitted;
use super::study::Study;
use crate::identify::{Shooting, uncertainty};
use crate::model::Model;

/// The model that is reported is fitted once more in finer steps (s), with friction that reverses over half the
/// speed: smoothing and steps shift dry friction by a few parts in a thousand, more than the noise of long logs does.
const FINE_STEP_S: f64 = 5e-4;

/// The chosen model, estimated in fine steps.
pub(super) struct Refined<'a> {
    /// The training logs in fine steps.
    pub study: Study<'a>,
    /// With 95 % intervals.
    pub model: Fitted,
}

/// Estimate the chosen model in fine steps.
pub(super) fn refine<'a>(study: &Study<'a>, chosen: &Fitted) -> Refined<'a> {
    let fine = study.refined();
    let mut model = fine.estimate(chosen);
    model.model = with_intervals(&fine, &model, chosen);
    Refined { study: fine, model }
}

impl Study<'_> {
    /// The same study in finer steps, to estimate a model that has been chosen. A width of friction's reversal that
    /// the model file gives stays.
    pub fn refined(&self) -> Self {
        let narrower = self.system.sign_width.as_ref().map_or(0.5, |_| 1.0);
        let sign_widths: Vec<f64> = self.sign_widths.iter().map(|w| narrower * w).collect();
        let windows = self.shooting.windows.clone();
        let shooting = Shooting::new(self.logs, windows, &self.shooting.noise);
        Self {
            sign_widths,
            shooting: shooting.in_steps_of(FINE_STEP_S),
            identifiability: self.identifiability.clone(),
            ..self.on(self.logs)
        }
    }

    /// A chosen model estimated anew; as it was where that fails.
    pub fn estimate(&self, chosen: &Fitted) -> Fitted {
        let locals = chosen.fit.locals.clone();
        self.refit(chosen, locals, None)
            .unwrap_or_else(|_| chosen.clone())
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
