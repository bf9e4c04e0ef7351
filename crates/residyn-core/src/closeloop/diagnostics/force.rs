use std::f64::consts::{PI, TAU};

use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::Log;
use crate::identify::{FitError, Shooting, Values, Window, fit};

/// The residual force of a model over one short block of a log: the constant generalised force that, added to
/// the torque, makes the model follow the logged positions best.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceSample {
    pub log: usize,
    /// Middle of the block in s.
    pub time_s: f64,
    /// Means over the block, one a joint.
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub tau: Vec<f64>,
    /// In N m (or N), one a joint.
    pub force: Vec<f64>,
}

/// The residual generalised force along the logs: found on trajectories, where no measurement is differentiated, or as
/// the torques that the smoothed motion needs beyond those that act. Angles are taken within the turn for joints that
/// make more than one.
///
/// # Errors
/// If the logs have no block, or the model diverges over a block.
pub(in crate::closeloop) fn residual_force(
    problem: &Problem<'_>,
    fitted: &Fitted,
) -> Result<Vec<ForceSample>, FitError> {
    let shooting = problem.windows_of(problem.settings.diagnostics.block_s);
    let forces = match problem.error_model {
        ErrorModel::OutputError => forces_of_motion(&shooting, fitted)?,
        ErrorModel::InverseDynamics => forces_of_torques(problem, &shooting, fitted)?,
    };
    let logs = problem.logs.iter();
    let torques: Vec<Vec<Vec<f64>>> = logs.map(|log| fitted.model.drive_torques(log)).collect();
    let sample = |(window, force): (&Window, &Vec<f64>)| {
        let (log, tau) = (&problem.logs[window.log], &torques[window.log]);
        ForceSample::over(window, log, tau, force)
    };
    let blocks = shooting.windows.iter().zip(&forces);
    let mut samples: Vec<ForceSample> = blocks.map(sample).collect();
    within_turn(&mut samples, &problem.declared.prismatic);
    Ok(samples)
}

/// For each window, the constant force that makes the model follow the log best.
fn forces_of_motion(shooting: &Shooting<'_>, fitted: &Fitted) -> Result<Vec<Vec<f64>>, FitError> {
    let dynamics = fitted.model.dynamics();
    let start_states = shooting.initial_start_states(dynamics.joints);
    let (_, found) = fit(shooting, &dynamics, &[], start_states, None)?;
    let force = |local: &Vec<f64>| local[2 * dynamics.joints..].to_vec();
    Ok(found.start_states.iter().map(force).collect())
}

/// For each window, the mean of the torques that its motion needs beyond those that act.
fn forces_of_torques(
    problem: &Problem<'_>,
    shooting: &Shooting<'_>,
    fitted: &Fitted,
) -> Result<Vec<Vec<f64>>, FitError> {
    let dynamics = problem.compiled(&fitted.model);
    let values = Values::of(&dynamics, problem.logs);
    let residuals = shooting.residuals(&dynamics, &values, &shooting.initial_start_states(0));
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
    /// The sample of one block of a log, with these torques and the force found there.
    fn over(window: &Window, log: &Log, tau: &[Vec<f64>], force: &[f64]) -> Self {
        let rows = window.first..=window.last;
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

/// For a turning joint that makes more than a full turn, take the angle within the turn, from -pi to pi: a force can
/// depend only on that angle.
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
