use std::f64::consts::{PI, TAU};

use crate::closeloop::fitted::Fitted;
use crate::closeloop::study::Study;
use crate::data::Log;
use crate::identify::{FitError, Window, fit};

/// The residual force of a model over one short stretch of a log: the constant generalised force that, added to
/// the torque, makes the model follow the logged positions best.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceSample {
    pub log: usize,
    /// Middle of the stretch in s.
    pub time_s: f64,
    /// Means over the stretch, one a joint.
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub tau: Vec<f64>,
    /// In N m (or N), one a joint.
    pub force: Vec<f64>,
}

/// The residual generalised force along the logs, found on trajectories: no measurement is differentiated. Angles are
/// within the turn where a joint makes more than one.
///
/// # Errors
/// Logs without a stretch, or a model that diverges over one of them.
pub(in crate::closeloop) fn residual_force(
    study: &Study<'_>,
    fitted: &Fitted,
) -> Result<Vec<ForceSample>, FitError> {
    let joints = study.declared.joints;
    let shooting = study.windows_of(study.settings.remainder.stretch_s);
    let locals = shooting.initial_locals(joints);
    let (_, found) = fit(&shooting, &fitted.model.dynamics(), &[], locals, None)?;
    let stretches = shooting.windows.iter().zip(&found.locals);
    let mut samples: Vec<ForceSample> = stretches
        .map(|(window, local)| {
            ForceSample::over(window, &study.logs[window.log], &local[2 * joints..])
        })
        .collect();
    within_turn(&mut samples, &study.declared.prismatic);
    Ok(samples)
}

impl ForceSample {
    /// The sample of one stretch of a log with the force that was found there.
    fn over(window: &Window, log: &Log, force: &[f64]) -> Self {
        let rows = window.first..=window.last;
        #[allow(clippy::cast_precision_loss)] // few rows
        let count = window.rows() as f64;
        let mean = |column: &Vec<f64>| rows.clone().map(|row| column[row]).sum::<f64>() / count;
        let span = log.time[window.last] - log.time[window.first];
        let speed = |q: &Vec<f64>| (q[window.last] - q[window.first]) / span;
        Self {
            log: window.log,
            time_s: log.time[window.first] + 0.5 * span,
            q: log.q.iter().map(mean).collect(),
            qd: log.q.iter().map(speed).collect(),
            tau: log.tau.iter().map(mean).collect(),
            force: force.to_vec(),
        }
    }
}

/// Where a turning joint makes more than a full turn, the angle within the turn, from -pi to pi: that is what a
/// force can depend on.
fn within_turn(samples: &mut [ForceSample], prismatic: &[bool]) {
    for (joint, _) in prismatic.iter().enumerate().filter(|(_, slides)| !**slides) {
        let reach = samples.iter().map(|s| s.q[joint].abs()).fold(0.0, f64::max);
        if reach > TAU {
            for sample in samples.iter_mut() {
                sample.q[joint] = (sample.q[joint] + PI).rem_euclid(TAU) - PI;
            }
        }
    }
}
