//! Whether an effect makes the torques of every log fit better. What fits torques best on the whole may be a part of the shape of
//! another effect, and then it helps on one log and harms on the next.

use super::establish::Standing;
use super::fitted::Fitted;
use crate::data::Log;
use crate::model::FittedEffect;
use crate::sim::metric::torque_error;

/// The first of these logs whose torques, on the joints of an effect, a model with it does not fit better than the one fitted
/// without it. None is fitted here.
pub(super) fn fits_as_well_without<'l>(
    logs: &[&'l Log],
    with: &Fitted,
    standing: &Standing,
) -> Option<&'l Log> {
    let without = standing.without.as_ref().ok()?;
    let helps = |log: &&&Log| {
        let error = |model: &Fitted| error(model, log, &standing.effect);
        matches!((error(with), error(without)), (Some(with), Some(without)) if with < without)
    };
    logs.iter().find(|log| !helps(log)).copied()
}

/// Sum of the mean squares of the torque error on an effect's joints, (N m)^2; `None` for a log that is too short.
fn error(model: &Fitted, log: &Log, effect: &FittedEffect) -> Option<f64> {
    let found = torque_error(&model.model, std::slice::from_ref(log))?;
    let joints = effect.joints().into_iter();
    Some(joints.map(|joint| found.rms[joint].powi(2)).sum())
}
