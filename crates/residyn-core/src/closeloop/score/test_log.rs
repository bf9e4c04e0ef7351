use std::slice;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::errors::Scorer;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::sim::metric::{Assessment, OpenLoop, summarise, torque_error};

/// The errors of the fitted declared model and of the one with effects on one test log, joint by joint: of positions at the
/// middle horizon in rad (or m), or of torques in N m (or N), whichever is compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TestLog {
    pub log: String,
    /// Of the declared model, fitted.
    pub before: Vec<f64>,
    /// Of the model with effects.
    pub after: Vec<f64>,
}

impl Scorer<'_> {
    /// The errors on each test log that is long enough; empty for a single log.
    pub fn log_by_log(
        &self,
        error_model: ErrorModel,
        models: [&Fitted; 2],
        motion: [&Assessment; 2],
    ) -> Vec<TestLog> {
        if self.test.len() < 2 {
            return Vec::new();
        }
        let error = |model: usize, log: usize| match error_model {
            ErrorModel::OutputError => of_motion(motion[model].middle(), log),
            ErrorModel::InverseDynamics => {
                let log = slice::from_ref(&self.test[log]);
                Some(torque_error(&models[model].model, log)?.rms)
            }
        };
        let of_log = |log: usize| {
            Some(TestLog {
                log: self.test[log].name(),
                before: error(0, log)?,
                after: error(1, log)?,
            })
        };
        (0..self.test.len()).filter_map(of_log).collect()
    }
}

/// `None` for a log without a window.
fn of_motion(all: &OpenLoop, log: usize) -> Option<Vec<f64>> {
    let windows = all.windows.iter().filter(|window| window.log == log);
    let windows: Vec<_> = windows.cloned().collect();
    let joints = windows.first()?.position.len();
    let of_log = OpenLoop { windows, ..*all };
    summarise(slice::from_ref(&of_log), joints)
        .position_rmse
        .pop()
}
