//! Over which speeds dry friction reverses, where the motion tells: grease, soft gears and the friction of simulators reverse over
//! far wider ones than a dry bearing.

use super::find::Loss;
use super::fitted::Fitted;
use super::study::Study;
use crate::data::Joint;
use crate::expr::Program;

impl Study<'_> {
    /// The widths of the joints' reversals with which a fitted model explains the logs better than with those of the study, by
    /// the share that a round of the search must, and the loss with those of the study; `None` where there are none, or the
    /// model file gives them.
    pub(super) fn wider_reversal(&self, fitted: &Fitted) -> Option<(Vec<f64>, f64)> {
        if self.declared.sign_width.is_some() {
            return None;
        }
        let enough = 1.0 - self.settings.select.step;
        let first = Loss::of(self, fitted).total();
        let (mut best, mut least) = (self.sign_widths.clone(), first);
        for joint in Joint::all(self.declared.joints) {
            let before = best.clone();
            let reverses = reversing(fitted, &before);
            for share in self.settings.fit.sign_widths {
                let mut widths = before.clone();
                widths[joint] = share * self.top_speed[joint].max(1e-6);
                let is_wider = widths[joint] > before[joint];
                if !is_wider || !self.has_time() || reversing(fitted, &widths) == reverses {
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
        let study = Study {
            sign_widths: widths.to_vec(),
            ..self.clone()
        };
        let again = study.estimate(fitted).ok()?;
        Some(Loss::of(&study, &again).total())
    }
}

/// The program of a model whose friction reverses over these speeds: the same as with others where it has none on a joint.
fn reversing(fitted: &Fitted, widths: &[f64]) -> Program {
    let model = fitted.model.with_sign_widths(widths.to_vec());
    model.dynamics().program
}
