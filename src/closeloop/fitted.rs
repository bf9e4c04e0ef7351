use std::ops::Deref;

use crate::data::Log;
use crate::identify::{Fit, Values};
use crate::model::{Dynamics, Model};
use crate::sim::metric::{Trace, traces};

/// A model as a fit to a study's logs left it. It is used as the model that it is.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// With the values found.
    pub model: Model,
    /// What the fit says of them.
    pub fit: Fit,
}

impl Deref for Fitted {
    type Target = Model;

    fn deref(&self) -> &Model {
        &self.model
    }
}

impl Fitted {
    /// `model`, compiled as `dynamics`, with what a fit of it to `logs` found.
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

    /// Predictions of a log: over consecutive windows of `horizon_s`, the motion from the logged state at the start of
    /// each under the logged torques.
    pub fn predict(&self, log: &Log, horizon_s: f64) -> Vec<Trace> {
        traces(&self.dynamics(), log, horizon_s)
    }
}
