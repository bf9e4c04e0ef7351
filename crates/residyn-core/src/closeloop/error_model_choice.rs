//! Choice of the error model: which errors say more about the logs.

use std::sync::Arc;

use super::fit::NOTHING;
use super::problem::Problem;
use super::select::baseline_friction;
use crate::data::statistics::{mean, upper_median};
use crate::data::{Log, Quantity, Smoothing};
use crate::identify::{Window, cut, fit_torques, has_torques};
use crate::model::{FittedEffect, Model};
use crate::sim::Steps;
use crate::sim::metric::{errors_in, torque_error};

impl Problem<'_> {
    /// Whether a controller prescribes the motion, so that the declared model, with baseline friction, explains far
    /// more of the torques than of half a second of open-loop motion, or the joints are too many for a fit of the
    /// motion in reasonable time. Never for a model that gives accelerations. Commands of one joint, of drives whose gains
    /// are unknown, or in logs whose rows are too far apart for all of the torques, tell more by the motion that they lead to:
    /// a closed loop does not diverge.
    pub(super) fn is_prescribed(&self) -> bool {
        self.tells_more_of_torques().unwrap_or(false)
    }

    /// `None` if there are no torques to compare, or no motion.
    fn tells_more_of_torques(&self) -> Option<bool> {
        let is_short = self.declared.joints <= self.settings.fit.most_joints_by_motion;
        let is_commanded = self.declared.driven_by() == Quantity::Command;
        let shows_torques = self.declared.joints > 1
            && self.declared.knows_law()
            && self.logs.iter().all(Smoothing::passes_full_band);
        if is_short && is_commanded && !shows_torques {
            return Some(false);
        }
        if !is_short || is_commanded {
            return has_torques(self.declared, self.logs).then_some(true);
        }
        let own = &self.declared.effects;
        let friction = baseline_friction(self);
        let effects = [own, friction.as_slice()].concat();
        let model = self.declared.with_effects(effects);
        let smoothed = self.smoothed(&model);
        let fitted = fit_torques(self.solver, &smoothed, self.declared, self.logs).ok()?;
        let torque = torque_error(&fitted.model, self.logs)?.relative;
        let far = self.settings.fit.motion_over_torque * torque;
        if self.motion_error(&fitted.model)? < far {
            return Some(false);
        }
        // A model may fit the torques well and still not move like the rig.
        let by_motion = Problem {
            declared: &model,
            library: &NOTHING,
            usual: Arc::default(),
            ..self.clone()
        };
        let by_motion = by_motion.fit_declared().ok()?;
        Some(self.motion_error(&by_motion.fitted.model)? >= far)
    }

    /// A few windows, spread evenly over the logs.
    pub(super) fn some_windows(&self) -> Vec<Window> {
        let windows = cut(self.logs, self.settings.fit.window_s);
        let every = windows.len().div_ceil(self.settings.fit.sample_windows);
        windows.into_iter().step_by(every.max(1)).collect()
    }

    /// What the declared model with these effects beside its own, fitted to the torques, leaves of each joint's; `None` if
    /// torques cannot be compared.
    pub(super) fn torques_left(&self, beside: &[FittedEffect]) -> Option<Vec<f64>> {
        let effects = [self.declared.effects.as_slice(), beside].concat();
        let model = self.smoothed(&self.declared.with_effects(effects));
        let fitted = fit_torques(self.solver, &model, self.declared, self.logs).ok()?;
        Some(fitted.shooting.noise)
    }

    /// The open-loop error of a model over a few windows of its logs, as a share of how far the joints move in them,
    /// over the joints that move at all; `None` if none does.
    fn motion_error(&self, model: &Model) -> Option<f64> {
        let windows = self.some_windows();
        let errors = errors_in(&model.dynamics(), self.logs, &windows, Steps::FIT);
        let share = |j: usize| {
            let way = |window: &Window| way(&self.logs[window.log], window, j);
            let ways: Vec<f64> = windows.iter().map(way).collect();
            let farthest = ways.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            let least = self.settings.fit.at_rest_share * farthest;
            let moving = errors.iter().zip(&ways).filter(|(_, way)| **way > least);
            let shares: Vec<f64> = moving.map(|(error, way)| error.position[j] / way).collect();
            (!shares.is_empty()).then(|| upper_median(&shares))
        };
        let shares: Vec<f64> = (0..model.joints).filter_map(share).collect();
        (!shares.is_empty()).then(|| mean(&shares).sqrt())
    }
}

/// Squared distance from the start of a window, summed over its rows.
fn way(log: &Log, window: &Window, joint: usize) -> f64 {
    let q = &log.q[joint][window.first..=window.last];
    q.iter().map(|at| (at - q[0]).powi(2)).sum()
}
