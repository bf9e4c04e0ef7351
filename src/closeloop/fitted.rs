use super::per_log::{joined, take_over};
use crate::data::Log;
use crate::identify::Fit;
use crate::model::{Dynamics, FittedEffect, put_own};
use crate::sim::metric::{Trace, traces};

/// A model fitted to a study's logs.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Values of the declared parameters.
    pub declared: Vec<f64>,
    /// Effects with their fitted values.
    pub effects: Vec<FittedEffect>,
    pub dynamics: Dynamics,
    pub fit: Fit,
}

impl Fitted {
    pub(super) fn new(
        dynamics: Dynamics,
        effects: &[FittedEffect],
        fit: Fit,
        declared: usize,
        logs: &[Log],
    ) -> Self {
        let mut effects = effects.to_vec();
        let mut values = fit.values[declared..].iter();
        for slot in effects.iter_mut().flat_map(|effect| &mut effect.values) {
            slot.0 = *values
                .next()
                .expect("the model has a value for each parameter");
        }
        let mut first = declared;
        for effect in &mut effects {
            let range = first..first + effect.values.len();
            first = range.end;
            take_over(effect, range, &fit, logs);
        }
        Self {
            declared: fit.values[..declared].to_vec(),
            effects,
            dynamics,
            fit,
        }
    }

    /// All parameters as they are in a log; one that the fit has not seen has no values of its own.
    pub fn values_in(&self, log: &Log) -> Vec<f64> {
        let mut values = joined(&self.declared, &self.effects);
        put_own(&mut values, self.declared.len(), &self.effects, log);
        values
    }

    /// Predictions of a log: over consecutive windows of `horizon_s`, the motion from the logged state at the start of
    /// each under the logged torques.
    pub fn predict(&self, log: &Log, horizon_s: f64) -> Vec<Trace> {
        traces(&self.dynamics, &self.values_in(log), log, horizon_s)
    }

    /// Where the parameters of the k-th effect stand among all parameters.
    pub fn range_of(&self, k: usize) -> std::ops::Range<usize> {
        let before: usize = self.effects[..k]
            .iter()
            .map(|effect| effect.values.len())
            .sum();
        let start = self.declared.len() + before;
        start..start + self.effects[k].values.len()
    }
}
