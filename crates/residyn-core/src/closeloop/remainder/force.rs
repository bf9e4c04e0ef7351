use std::f64::consts::{PI, TAU};

use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::space::Space;
use crate::data::Log;
use crate::identify::{FitError, Shooting, Values, Window, fit};

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

/// The residual generalised force along the logs: found on trajectories, where no measurement is differentiated, or by the
/// torques that the smoothed motion needs beside those that act. Angles are within the turn where a joint makes more than one.
///
/// # Errors
/// Logs without a stretch, or a model that diverges over one of them.
pub(in crate::closeloop) fn residual_force(
    problem: &Problem<'_>,
    fitted: &Fitted,
) -> Result<Vec<ForceSample>, FitError> {
    let shooting = problem.windows_of(problem.settings.remainder.stretch_s);
    let forces = match problem.space {
        Space::Motion => forces_of_motion(&shooting, fitted)?,
        Space::Torque => forces_of_torques(problem, &shooting, fitted)?,
    };
    let logs = problem.logs.iter();
    let torques: Vec<Vec<Vec<f64>>> = logs.map(|log| fitted.model.drive_torques(log)).collect();
    let sample = |(window, force): (&Window, &Vec<f64>)| {
        ForceSample::over(
            window,
            &problem.logs[window.log],
            &torques[window.log],
            force,
        )
    };
    let stretches = shooting.windows.iter().zip(&forces);
    let mut samples: Vec<ForceSample> = stretches.map(sample).collect();
    within_turn(&mut samples, &problem.declared.prismatic);
    Ok(samples)
}

/// For each window the constant force that makes the model follow the log best.
fn forces_of_motion(shooting: &Shooting<'_>, fitted: &Fitted) -> Result<Vec<Vec<f64>>, FitError> {
    let dynamics = fitted.model.dynamics();
    let locals = shooting.initial_locals(dynamics.joints);
    let (_, found) = fit(shooting, &dynamics, &[], locals, None)?;
    let force = |local: &Vec<f64>| local[2 * dynamics.joints..].to_vec();
    Ok(found.locals.iter().map(force).collect())
}

/// For each window the mean of the torques by which its motion needs more than acts.
fn forces_of_torques(
    problem: &Problem<'_>,
    shooting: &Shooting<'_>,
    fitted: &Fitted,
) -> Result<Vec<Vec<f64>>, FitError> {
    let dynamics = problem.compiled(&fitted.model);
    let values = Values::of(&dynamics, problem.logs);
    let residuals = shooting.residuals(&dynamics, &values, &shooting.initial_locals(0));
    if residuals.is_empty() {
        return Err(FitError::NoWindow);
    }
    let mean = |of_window: &Vec<f64>| {
        let rows = (of_window.len() / dynamics.joints) as f64;
        let of_joint = |(j, noise): (usize, &f64)| {
            let own = of_window.iter().skip(j).step_by(dynamics.joints);
            noise * own.sum::<f64>() / rows
        };
        shooting.noise.iter().enumerate().map(of_joint).collect()
    };
    Ok(residuals.iter().map(mean).collect())
}

impl ForceSample {
    /// The sample of one stretch of a log, under these torques, with the force that was found there.
    fn over(window: &Window, log: &Log, tau: &[Vec<f64>], force: &[f64]) -> Self {
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
            tau: tau.iter().map(mean).collect(),
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
