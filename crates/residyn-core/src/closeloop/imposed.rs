//! Whether the motion of the logs is imposed on the rig: the force follows from the motion, and not the motion from the
//! force.

use super::problem::Problem;
use super::select::usual_forces;
use crate::data::half_width_s;
use crate::data::statistics::sample_deviation;
use crate::identify::{Window, cut, fit_torques, initial_state};
use crate::sim::metric::errors_in;

impl Problem<'_> {
    /// Whether the motion explains most of each joint's torque, while the torques explain far less of the motion: a
    /// bench moves the rig, and a sensor measures what that takes. Never without a first optimum or without torques.
    pub(super) fn is_imposed(&self) -> bool {
        let left = self.first.as_ref().and_then(|_| self.left_of_torques());
        let settings = &self.settings.fit;
        left.is_some_and(|torque| {
            torque < settings.imposed_torque_share
                && self.left_of_motion() > Some(settings.imposed_motion * torque)
        })
    }

    /// What the declared model with the usual forces, fitted to the torques, leaves of their standard deviation on the
    /// joint on which it leaves most; `None` if torques cannot be compared.
    fn left_of_torques(&self) -> Option<f64> {
        let effects = [self.declared.effects.as_slice(), &usual_forces(self)].concat();
        let model = self.smoothed(&self.declared.with_effects(effects));
        let fitted = fit_torques(self.solver, &model, self.declared, self.logs).ok()?;
        let share = |(joint, left): (usize, &f64)| {
            let torque = self.logs.iter().flat_map(|log| &log.tau[joint]);
            left / sample_deviation(&torque.copied().collect::<Vec<f64>>())
        };
        let shares = fitted.shooting.noise.iter().enumerate().map(share);
        shares.max_by(f64::total_cmp)
    }

    /// What the first optimum leaves of the distance from a motion that goes on as each window begins.
    fn left_of_motion(&self) -> Option<f64> {
        let windows = cut(self.logs, self.settings.fit.window_s);
        let every = windows.len().div_ceil(self.settings.fit.sample_windows);
        let windows: Vec<Window> = windows.into_iter().step_by(every.max(1)).collect();
        let dynamics = self.first.as_ref()?.model.dynamics();
        let errors = errors_in(&dynamics, self.logs, &windows, self.shooting.longest_s());
        let driven: f64 = errors.iter().flat_map(|error| &error.position).sum();
        let uniform = |window: &Window| self.beyond_uniform_motion(window);
        let uniform: f64 = windows.iter().filter_map(uniform).sum();
        Some((driven / uniform).sqrt())
    }

    /// Squares of the distance from a motion that goes on as the window begins, summed over rows and joints.
    fn beyond_uniform_motion(&self, window: &Window) -> Option<f64> {
        let log = &self.logs[window.log];
        let start = initial_state(log, half_width_s(log.median_step()), window.first)?;
        let (angles, velocities) = start.split_at(log.q.len());
        let of_joint = |(joint, q): (usize, &Vec<f64>)| -> f64 {
            let off = |row: usize| {
                let passed_s = log.time[row] - log.time[window.first];
                q[row] - angles[joint] - velocities[joint] * passed_s
            };
            (window.first..=window.last)
                .map(|row| off(row).powi(2))
                .sum()
        };
        Some(log.q.iter().enumerate().map(of_joint).sum())
    }
}
