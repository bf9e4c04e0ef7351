//! Whether the motion of the logs is imposed on the rig: the force follows from the motion, and not the motion from the
//! force.

use super::problem::Problem;
use super::select::usual_forces;
use crate::data::statistics::sample_deviation;
use crate::data::{Quantity, Smooth, half_width_s};
use crate::identify::{Window, initial_state};
use crate::model::Dynamics;
use crate::sim::metric::{balance_of, errors_in};

impl Problem<'_> {
    /// Whether the motion explains most of each joint's torque, while the declared inertia takes next to nothing of it, or
    /// the torques explain far less of the motion: a bench moves the rig, and a sensor measures what that takes. Never
    /// without a first optimum or without torques.
    pub(super) fn is_imposed(&self) -> bool {
        let has_torques = self.first.is_some() && self.declared.driven_by() == Quantity::Torque;
        let left = has_torques.then(|| self.left_of_torques()).flatten();
        let settings = &self.settings.fit;
        left.is_some_and(|torque| {
            torque < settings.imposed_torque_share
                && (self.share_of_inertia() < Some(settings.imposed_inertia)
                    || self.left_of_motion() > Some(settings.imposed_motion * torque))
        })
    }

    /// What accelerating the declared model takes of the torques' standard deviation, on the joint on which it takes
    /// most; `None` if torques cannot be compared.
    fn share_of_inertia(&self) -> Option<f64> {
        let balance = self.declared.with_effects(Vec::new()).torque_balance()?;
        let logs: Vec<Smooth> = self.logs.iter().map(Smooth::of).collect();
        let inertial: Vec<Vec<Vec<f64>>> = logs
            .iter()
            .map(|log| inertial_torques(&balance, log))
            .collect();
        let share = |joint: usize| {
            let inertial = inertial.iter().flat_map(|of| &of[joint]).copied();
            let torque = logs.iter().flat_map(|log| &log.tau[joint]).copied();
            let [inertial, torque]: [Vec<f64>; 2] = [inertial.collect(), torque.collect()];
            sample_deviation(&inertial) / sample_deviation(&torque)
        };
        (0..self.declared.joints).map(share).max_by(f64::total_cmp)
    }

    /// What the declared model with the usual forces, fitted to the torques, leaves of their standard deviation on the
    /// joint on which it leaves most; `None` if torques cannot be compared.
    fn left_of_torques(&self) -> Option<f64> {
        let left = self.torques_left(&usual_forces(self))?;
        let share = |(joint, left): (usize, &f64)| {
            let torque = self.logs.iter().flat_map(|log| &log.tau[joint]);
            left / sample_deviation(&torque.copied().collect::<Vec<f64>>())
        };
        let shares = left.iter().enumerate().map(share);
        shares.max_by(f64::total_cmp)
    }

    /// What the first optimum leaves of the distance from a motion that goes on as each window begins.
    fn left_of_motion(&self) -> Option<f64> {
        let windows = self.some_windows();
        let dynamics = self.first.as_ref()?.model.dynamics();
        let errors = errors_in(&dynamics, self.logs, &windows, self.shooting.steps());
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

/// What a motion takes beyond the same motion without acceleration, `[joint][row]`.
fn inertial_torques(balance: &Dynamics, moving: &Smooth) -> Vec<Vec<f64>> {
    let none = vec![vec![0.0; moving.rows()]; moving.q.len()];
    let moving = Smooth {
        tau: none.clone(),
        ..moving.clone()
    };
    let steady = Smooth {
        qdd: none,
        ..moving.clone()
    };
    let [with, without] = [moving, steady].map(|of| balance_of(balance, &of, &[]));
    let beyond = |(with, without): (&Vec<f64>, &Vec<f64>)| {
        with.iter()
            .zip(without)
            .map(|(with, without)| with - without)
            .collect()
    };
    with.iter().zip(&without).map(beyond).collect()
}
