use crate::data::Log;
use crate::identify::{Fit, Values};
use crate::model::{Dynamics, FittedEffect, Model};
use crate::sim::metric::{Trace, traces};

/// A model fitted to a problem's logs.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// With the values found.
    pub model: Model,
    /// How the fit ended, and its normal equations there.
    pub fit: Fit,
}

impl Fitted {
    /// `model`, compiled as `dynamics`, with the result of its fit to `logs`.
    pub(super) fn new(
        model: &Model,
        dynamics: &Dynamics,
        (found, fit): (Values, Fit),
        logs: &[Log],
    ) -> Self {
        Self {
            model: model.at(&found.put_into(dynamics, logs)),
            fit,
        }
    }

    /// The same without the normal equations of each window.
    pub(super) fn without_windows(self) -> Self {
        Self {
            fit: self.fit.without_windows(),
            ..self
        }
    }

    /// The cost of the fit in units of the squared noise: the fit states it in units of its squared scale.
    pub(super) fn loss(&self) -> f64 {
        self.fit.cost * self.fit.scale.powi(2)
    }

    /// The effects of the model and more.
    pub(super) fn effects_and(&self, more: &[FittedEffect]) -> Vec<FittedEffect> {
        [self.model.effects.as_slice(), more].concat()
    }

    /// Predictions of a log: over consecutive windows of `horizon_s`, the motion from the logged state at the start of
    /// each under the logged torques.
    pub fn predict(&self, log: &Log, horizon_s: f64) -> Vec<Trace> {
        traces(&self.model.dynamics(), log, horizon_s)
    }
}
