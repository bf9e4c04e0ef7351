//! Over which speeds dry friction reverses, if the motion shows it: grease, soft gears and simulated friction reverse
//! over far wider ranges of speed than a dry bearing.

use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::loss::Loss;
use super::problem::Problem;
use super::stage::Watch;
use crate::data::Joint;
use crate::expr::Program;

impl Problem<'_> {
    /// Wider smoothing velocities with which a fitted model explains the logs better than with the problem's, by at
    /// least the gain required of a search round, and the loss with the problem's; `None` if there are none, if the
    /// model file gives them, or if torques are compared.
    pub(super) fn wider_reversal(
        &self,
        fitted: &Fitted,
        watch: &dyn Watch,
    ) -> Option<(Vec<f64>, f64)> {
        if self.error_model == ErrorModel::InverseDynamics
            || self.declared.smoothing_velocity.is_some()
        {
            return None;
        }
        let enough = 1.0 - self.settings.select.round_gain;
        let first = Loss::of(self, fitted).total();
        let (mut best, mut least) = (self.smoothing_velocities.clone(), first);
        for joint in Joint::all(self.declared.joints) {
            let before = best.clone();
            let reverses = reversing(fitted, &before);
            for share in self.settings.fit.wider_sign_shares {
                let mut widths = before.clone();
                widths[joint] = width(share, self.top_speed[joint]);
                let is_wider = widths[joint] > before[joint];
                if !is_wider || watch.has_to_end() || reversing(fitted, &widths) == reverses {
                    continue;
                }
                let loss = self.loss_with(fitted, &widths).unwrap_or(f64::INFINITY);
                if loss < enough * least {
                    (best, least) = (widths, loss);
                }
            }
        }
        (least < first).then_some((best, first))
    }

    /// The loss of a model, refitted with these widths.
    fn loss_with(&self, fitted: &Fitted, widths: &[f64]) -> Option<f64> {
        let problem = self.with_smoothing_velocities(widths.to_vec());
        let again = problem.estimate(fitted).ok()?;
        Some(Loss::of(&problem, &again).total())
    }
}

/// This share of a joint's top speed, as a smoothing velocity, which is never zero.
pub(super) fn width(share: f64, top_speed: f64) -> f64 {
    share * top_speed.max(1e-6)
}

/// The program of a model with these smoothing velocities: a joint's width changes nothing if it has no dry friction.
fn reversing(fitted: &Fitted, widths: &[f64]) -> Program {
    let model = fitted.model.with_smoothing_velocities(widths.to_vec());
    model.dynamics().program
}
