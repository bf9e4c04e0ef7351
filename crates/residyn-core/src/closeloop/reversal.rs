//! Over which speeds dry friction reverses, where the motion tells: grease, soft gears and the friction of simulators reverse over
//! far wider ones than a dry bearing.

use super::fitted::Fitted;
use super::loss::Loss;
use super::problem::Problem;
use super::space::Space;
use super::stage::Watch;
use crate::data::Joint;
use crate::expr::Program;

impl Problem<'_> {
    /// The widths of the joints' reversals with which a fitted model explains the logs better than with those of the problem, by
    /// the share that a round of the search must, and the loss with those of the problem; `None` where there are none, or the
    /// model file gives them, or torques are compared.
    pub(super) fn wider_reversal(
        &self,
        fitted: &Fitted,
        watch: &dyn Watch,
    ) -> Option<(Vec<f64>, f64)> {
        if self.space == Space::Torque || self.declared.sign_width.is_some() {
            return None;
        }
        let enough = 1.0 - self.settings.select.round_gain;
        let first = Loss::of(self, fitted).total();
        let (mut best, mut least) = (self.sign_widths.clone(), first);
        for joint in Joint::all(self.declared.joints) {
            let before = best.clone();
            let reverses = reversing(fitted, &before);
            for share in self.settings.fit.wider_sign_shares {
                let mut widths = before.clone();
                widths[joint] = share * self.top_speed[joint].max(1e-6);
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

    /// The loss of a model, fitted again with these widths.
    fn loss_with(&self, fitted: &Fitted, widths: &[f64]) -> Option<f64> {
        let problem = self.with_sign_widths(widths.to_vec());
        let again = problem.estimate(fitted).ok()?;
        Some(Loss::of(&problem, &again).total())
    }
}

/// The program of a model whose friction reverses over these speeds: the same as with others where it has none on a joint.
fn reversing(fitted: &Fitted, widths: &[f64]) -> Program {
    let model = fitted.model.with_sign_widths(widths.to_vec());
    model.dynamics().program
}
