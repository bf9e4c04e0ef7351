use rayon::prelude::*;

use super::errors::{Scored, Scorer};
use crate::closeloop::error_model::ErrorModel;
use crate::data::Log;
use crate::model::Dynamics;
use crate::sim::metric::{NeededTorques, Trace, needed_torques, traces};

/// What the models predict for the test logs, for plots.
pub struct Predictions {
    /// Over the longest horizon, one per test log: differences between models grow with the horizon. Empty if torques
    /// are compared.
    pub longest: Vec<Predicted>,
    /// Over the middle horizon, for the first test log.
    pub middle: Option<Predicted>,
    /// One per test log, if torques are compared.
    pub torques: Vec<Needed>,
}

/// Consecutive predictions of a log by several models, each started from the log.
pub struct Predicted {
    pub horizon_s: f64,
    /// Of the declared model, fitted.
    pub before: Vec<Trace>,
    /// With effects.
    pub after: Vec<Trace>,
    /// With the residual network, if there is one.
    pub hybrid: Option<Vec<Trace>>,
}

/// The torques that a log's motion needs according to two models; `None` for a model that gives accelerations.
pub struct Needed {
    pub before: Option<NeededTorques>,
    /// With effects.
    pub after: Option<NeededTorques>,
}

impl Scorer<'_> {
    /// What the models predict for the test logs; `network` is the model with the network.
    pub fn predictions(&self, models: Scored<'_>, network: Option<&Dynamics>) -> Predictions {
        let fitted = [models.before, models.after];
        let [before, after] = fitted.map(|fitted| fitted.model.dynamics());
        let predicted = |log: &Log, horizon_s: f64, network: Option<&Dynamics>| Predicted {
            horizon_s,
            before: traces(&before, log, horizon_s),
            after: traces(&after, log, horizon_s),
            hybrid: network.map(|network| traces(network, log, horizon_s)),
        };
        let longest_s = self.settings.horizons_s.iter().copied().fold(0.0, f64::max);
        let of_motion = |log: &Log| predicted(log, longest_s, network);
        let of_torques = |log: &Log| {
            let [before, after] = fitted.map(|fitted| needed_torques(&fitted.model, log));
            Needed { before, after }
        };
        let logs = self.test.par_iter();
        let (longest, torques) = match models.problem.error_model {
            ErrorModel::OutputError => (logs.map(of_motion).collect(), Vec::new()),
            ErrorModel::InverseDynamics => (Vec::new(), logs.map(of_torques).collect()),
        };
        let first = self.test.first();
        Predictions {
            longest,
            middle: first.map(|log| predicted(log, self.settings.middle_s(), None)),
            torques,
        }
    }
}
