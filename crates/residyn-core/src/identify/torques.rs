use super::fit::fit_by;
use super::outcome::{Fit, FitError};
use super::shooting::Shooting;
use super::solver::Solver;
use super::values::free_parameters;
use crate::data::Log;
use crate::model::Model;
use crate::model::tree::physical_parts;
use crate::sim::cut;

/// Length of the windows that are left out or resampled as one, s.
const WINDOW_S: f64 = 0.5;
/// The noise of the joints is that of the residuals, which depend on it: it has settled after this many fits.
const FITS: usize = 3;

/// A model fitted to torques.
pub struct TorqueFit<'l> {
    pub model: Model,
    pub fit: Fit,
    /// What it was fitted to: its noise is that of each joint's torque.
    pub shooting: Shooting<'l>,
}

/// Whether a model can be fitted to torques: it has a torque balance, and the logs have a window.
pub fn has_torques(model: &Model, logs: &[Log]) -> bool {
    model.smoothed_torque_balance().is_some() && !torques_of(model, logs).windows.is_empty()
}

/// The torques of the logged motion, each joint's with a noise of one.
fn torques_of<'l>(model: &Model, logs: &'l [Log]) -> Shooting<'l> {
    let (windows, noise) = (cut(logs, WINDOW_S), vec![1.0; model.joints]);
    Shooting::of_torques(logs, windows, &noise, &model.smoothing_velocities())
}

/// Fit a model to the torques that the motion in the logs needs, near the values of `declared`. A joint counts by how
/// well its torque is predicted; bodies stay physical.
///
/// # Errors
/// A model that gives accelerations or logs of less than two seconds, as [`FitError::NoWindow`], and those of [`fit_by`].
pub fn fit_torques<'l>(
    solver: &dyn Solver,
    model: &Model,
    declared: &Model,
    logs: &'l [Log],
) -> Result<TorqueFit<'l>, FitError> {
    let mut model = with_physical_bodies(model);
    let mut noise = vec![1.0; model.joints];
    let smoothed = torques_of(&model, logs).near(declared);
    let mut found = None;
    for _ in 0..FITS {
        let balance = model.smoothed_torque_balance().ok_or(FitError::NoWindow)?;
        let shooting = smoothed.with_noise(&noise);
        let active = free_parameters(&balance);
        let start_states = shooting.initial_start_states(0);
        let (values, fitted) = fit_by(solver, &shooting, &balance, &active, start_states, None)?;
        let balance = values.put_into(&balance, logs);
        noise = shooting.left_by(&balance, &values, &fitted.start_states);
        model = model.at(&balance);
        found = Some((fitted, shooting));
    }
    let (fit, shooting) = found.expect("there is at least one fit");
    Ok(TorqueFit {
        model,
        fit,
        shooting,
    })
}

/// The same model with bodies that are not physical replaced by the nearest physical ones.
fn with_physical_bodies(model: &Model) -> Model {
    let mut model = model.clone();
    for body in model.inertias() {
        let parts = body.map(|parameter| model.parameters[parameter].value);
        let Some(physical) = physical_parts(&parts) else {
            continue;
        };
        for (parameter, value) in body.into_iter().zip(physical) {
            if !model.parameters[parameter].fixed {
                model.parameters[parameter].value = value;
            }
        }
    }
    model
}
