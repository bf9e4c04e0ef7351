//! Whether an effect makes the torques of every log fit better. An effect that fits the torques best overall may
//! imitate a part of another effect, and then it helps on one log and harms on the next.

use super::establish::Standing;
use super::fitted::Fitted;
use crate::data::Log;
use crate::sim::metric::torque_error_with;

/// Torque errors of a model on each of some logs.
pub(super) struct EveryLog<'l> {
    /// Per joint in N m (or N); `None` for a log that is too short.
    errors: Vec<(&'l Log, Option<Vec<f64>>)>,
    /// The joints with dry friction.
    dry: Vec<bool>,
}

impl<'l> EveryLog<'l> {
    pub fn of(logs: impl Iterator<Item = &'l Log>, model: &Fitted) -> Self {
        let dry = model.model.dry_joints();
        Self {
            errors: logs.map(|log| (log, errors(model, log, &dry))).collect(),
            dry,
        }
    }

    /// The first log whose torques, on the joints of an effect, the model fits no better than the model without the
    /// effect. Neither is fitted here. A log in which these joints rest says nothing.
    pub fn fits_as_well_without(&self, standing: &Standing) -> Option<&'l Log> {
        let without = standing.without.as_ref().ok()?;
        let joints = standing.effect.joints();
        let of_effect =
            |rms: &[f64]| -> f64 { joints.iter().map(|joint| rms[*joint].powi(2)).sum() };
        let helps = |(log, with): &&(&Log, Option<Vec<f64>>)| {
            let without = errors(without, log, &self.dry);
            let (Some(with), Some(without)) = (with, without) else {
                return false;
            };
            let [with, without] = [with, &without].map(|rms| of_effect(rms));
            with < without || without == 0.0
        };
        let found = self.errors.iter().find(|of_log| !helps(of_log));
        found.map(|(log, _)| *log)
    }
}

fn errors(model: &Fitted, log: &Log, dry: &[bool]) -> Option<Vec<f64>> {
    Some(torque_error_with(&model.model, std::slice::from_ref(log), dry)?.rms)
}
