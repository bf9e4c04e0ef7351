//! The log that a rig would give under a designed motion, without noise.

use std::num::NonZeroU32;

use residyn_core::data::Log;
use residyn_core::identify::{Shooting, cut, longest_stable_step};
use residyn_core::limits::is_reading;
use residyn_core::model::{Dynamics, Model};
use residyn_core::sim::{Environment, FIT_S, Integrator, RK4};

use crate::error::ExciteError;
use crate::motion::WINDOW_S;

/// Bandwidth of the controller that keeps a torque-driven rig on its motion, rad/s: far above that of the motion, and far
/// below the rate of its rows.
const BANDWIDTH: f64 = 15.0;

/// How long the first command has been held when the motion begins, s: longer than delays and lags are.
const RESTED_S: f64 = 0.5;

/// A motion in rows with what drives it: `[joint][row]`, the drive of a row held until the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// s
    pub time: Vec<f64>,
    /// rad (or m), and per s.
    pub q: Vec<Vec<f64>>,
    pub qd: Vec<Vec<f64>>,
    /// N m (or N), or commands of the drives.
    pub command: Vec<Vec<f64>>,
}

/// The longest step in which the model follows the reference as it should, s.
fn longest_s(model: &Model, dynamics: &Dynamics, reference: &Reference) -> f64 {
    let log = Log {
        time: reference.time.clone(),
        q: reference.q.clone(),
        qd: reference.qd.clone(),
        tau: reference.command.clone(),
        driven_by: model.driven_by(),
        ..Log::empty(model.joints)
    };
    let logs = [log];
    let shooting = Shooting::new(&logs, cut(&logs, WINDOW_S), &vec![1.0; model.joints]);
    FIT_S.min(longest_stable_step(&shooting, dynamics, RK4))
}

/// The motion of a model that follows a reference. Commands of drives are its input as they are; torques drift, so that a
/// controller adds what keeps the angle near the reference, as on a rig.
///
/// # Errors
/// A model that diverges.
pub fn record(model: &Model, reference: &Reference) -> Result<Log, ExciteError> {
    let n = model.joints;
    let dynamics = model.dynamics();
    let gains = match model.drive_program() {
        Some(_) => vec![0.0; n],
        None => model.joint_inertias(),
    };
    let step_s = reference.time[1] - reference.time[0];
    let longest_s = longest_s(model, &dynamics, reference);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive number
    let substeps = NonZeroU32::new((step_s / longest_s).ceil() as u32).unwrap_or(NonZeroU32::MIN);
    let mut environment = Environment::new(&dynamics, Integrator::fine(substeps), step_s);
    let mut state: Vec<f64> = reference.q.iter().map(|q| q[0]).collect();
    state.extend(reference.qd.iter().map(|qd| qd[0]));
    let first: Vec<f64> = reference.command.iter().map(|channel| channel[0]).collect();
    rest(&mut environment, &state, &first, step_s);
    let mut log = Log {
        driven_by: model.driven_by(),
        path: "designed".into(),
        ..Log::empty(n)
    };
    for (row, time) in reference.time.iter().enumerate() {
        let shown = environment.angles(&state, *time);
        let command: Vec<f64> = (0..n)
            .map(|joint| {
                let behind = reference.q[joint][row] - state[joint];
                let slower = reference.qd[joint][row] - state[n + joint];
                let back = BANDWIDTH.powi(2) * behind + 2.0 * BANDWIDTH * slower;
                reference.command[joint][row] + gains[joint] * back
            })
            .collect();
        log.time.push(*time);
        for joint in 0..n {
            log.q[joint].push(shown[joint]);
            log.qd[joint].push(state[n + joint]);
            log.tau[joint].push(command[joint]);
        }
        environment.step(&mut state, &command, *time);
        if !state.iter().copied().all(is_reading) {
            return Err(ExciteError::NotFinite);
        }
    }
    Ok(log)
}

/// Fill delays and lags as if the rig had rested under its first command.
fn rest(environment: &mut Environment<'_>, state: &[f64], command: &[f64], step_s: f64) {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few hundred
    let steps = (RESTED_S / step_s).ceil() as usize;
    for before in (1..=steps).rev() {
        environment.step(&mut state.to_vec(), command, -step_s * before as f64);
    }
}
