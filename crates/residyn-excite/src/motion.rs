//! What a motion tells where the rig's angles are compared, not its torques: by the sensitivities of the simulated motion in
//! the windows of the core's fits, each with a free start.

use nalgebra::DMatrix;

use residyn_core::data::Log;
use residyn_core::identify::{Shooting, Values, as_it_stands, cut, fit, stable_steps};
use residyn_core::model::{Dynamics, Model};

use crate::error::ExciteError;
use crate::limits::Limits;

/// Length of the windows in which fits compare a motion, s.
pub const WINDOW_S: f64 = 0.5;
/// With more joints torques are compared, also where commands drive: a fit of the motion takes minutes.
const MOST_JOINTS: usize = 3;

/// Whether the angles of a rig are compared: the rows of its commands or the equations themselves give no torque.
pub fn compares_motion(model: &Model) -> bool {
    let has_no_torque = model.drive_program().is_some() || !model.has_mass_matrix();
    has_no_torque && model.joints <= MOST_JOINTS
}

fn shooting<'l>(logs: &'l [Log], limits: &Limits, dynamics: &Dynamics) -> Shooting<'l> {
    let noise: Vec<f64> = limits
        .joints
        .iter()
        .map(|joint| joint.encoder_noise)
        .collect();
    let shooting = Shooting::new(logs, cut(logs, WINDOW_S), &noise);
    let steps = stable_steps(&shooting, dynamics, 0.0);
    shooting.in_steps(steps)
}

/// The information of a log without noise on the free parameters.
///
/// # Errors
/// A log that is too short, or a model that diverges.
pub fn information(model: &Model, log: &Log, limits: &Limits) -> Result<DMatrix<f64>, ExciteError> {
    let logs = std::slice::from_ref(log);
    let dynamics = model.dynamics();
    let shooting = shooting(logs, limits, &dynamics);
    let active: Vec<usize> = (0..dynamics.parameters.len())
        .filter(|k| !dynamics.parameters[*k].fixed)
        .collect();
    let starts = shooting.initial_start_states(0);
    let fit = as_it_stands(&shooting, &dynamics, &active, starts, 1.0);
    Ok(fit.map_err(|_| ExciteError::ShortLogs)?.equations().hessian)
}

/// The squared residuals over the noise that a fit of the model leaves of another rig's log.
///
/// # Errors
/// As above.
pub fn evidence(model: &Model, log: &Log, limits: &Limits) -> Result<f64, ExciteError> {
    let logs = std::slice::from_ref(log);
    let dynamics = model.dynamics();
    // The rows around a start are the window's own: its estimate is no further evidence.
    let shooting = shooting(logs, limits, &dynamics).with_free_starts();
    let active: Vec<usize> = (0..dynamics.parameters.len())
        .filter(|k| !dynamics.parameters[*k].fixed)
        .collect();
    let starts = shooting.initial_start_states(0);
    // A scale far above the residuals makes the robust loss quadratic.
    let found = fit(&shooting, &dynamics, &active, starts, Some(1e6));
    let (values, found) = found.map_err(|_| ExciteError::ShortLogs)?;
    let fitted = values.put_into(&dynamics, logs);
    let values = Values::of(&fitted, logs);
    let residuals = shooting.residuals(&fitted, &values, &found.start_states);
    Ok(residuals
        .iter()
        .flatten()
        .map(|residual| residual.powi(2))
        .sum())
}
