use std::f64::consts::{PI, TAU};

use super::study::{Fitted, Study};
use crate::data::statistics::upper_median;
use crate::identify::{Shooting, cut, fit};

/// What the model lacks over one short stretch of a log: the constant generalised force that, added to
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

/// Length of the stretches in s: short against a swing, long enough that encoder noise of 1 mrad makes an
/// error of 0.3 rad/s^2.
const STRETCH_S: f64 = 0.15;

/// The residual generalised force along the logs, found on trajectories: no measurement is differentiated.
pub fn residual_force(study: &Study<'_>, model: &Fitted) -> Vec<ForceSample> {
    let joints = study.system.joints;
    let shooting = Shooting::new(
        study.logs,
        cut(study.logs, STRETCH_S),
        &study.shooting.noise,
    );
    let locals = shooting.initial_locals(joints);
    let Ok(found) = fit(
        &shooting,
        &model.dynamics,
        &[],
        model.fit.found(),
        locals,
        None,
    ) else {
        return Vec::new();
    };
    shooting
        .windows
        .iter()
        .zip(&found.locals)
        .map(|(window, local)| {
            let log = &study.logs[window.log];
            let rows = window.first..=window.last;
            let mean = |column: &Vec<f64>| {
                #[allow(clippy::cast_precision_loss)] // few rows
                let count = rows.clone().count() as f64;
                rows.clone().map(|row| column[row]).sum::<f64>() / count
            };
            let span = log.time[window.last] - log.time[window.first];
            ForceSample {
                log: window.log,
                time_s: log.time[window.first] + 0.5 * span,
                q: log.q.iter().map(mean).collect(),
                qd: log
                    .q
                    .iter()
                    .map(|q| (q[window.last] - q[window.first]) / span)
                    .collect(),
                tau: log.tau.iter().map(mean).collect(),
                force: local[2 * joints..].to_vec(),
            }
        })
        .collect()
}

/// Where a turning joint makes more than a full turn, the angle within the turn, from -pi to pi: that is what a
/// force can depend on.
pub fn within_turn(samples: &mut [ForceSample], prismatic: &[bool]) {
    for (joint, _) in prismatic.iter().enumerate().filter(|(_, slides)| !**slides) {
        let reach = samples.iter().map(|s| s.q[joint].abs()).fold(0.0, f64::max);
        if reach > TAU {
            for sample in samples.iter_mut() {
                sample.q[joint] = (sample.q[joint] + PI).rem_euclid(TAU) - PI;
            }
        }
    }
}

/// Root mean square of the residual force over stretches and joints, outliers weighing no more than three
/// times the median: in N m (or N).
pub fn norm(samples: &[ForceSample]) -> f64 {
    let squares: Vec<f64> = samples
        .iter()
        .flat_map(|s| s.force.iter().map(|f| f * f))
        .collect();
    if squares.is_empty() {
        return 0.0;
    }
    let limit = 9.0 * upper_median(&squares);
    #[allow(clippy::cast_precision_loss)] // few stretches
    let count = squares.len() as f64;
    (squares.iter().map(|s| s.min(limit)).sum::<f64>() / count).sqrt()
}
