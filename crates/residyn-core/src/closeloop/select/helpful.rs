//! Effects that no value switches off: only fits tell which of them help.

use super::candidate::starts;
use super::screen::with_one_more;
use super::trial::Trial;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::problem::Problem;
use crate::model::FittedEffect;

/// Those that help.
pub(super) struct Helpful {
    /// At the values that fits to the sample of windows led them to.
    effects: Vec<FittedEffect>,
    /// Loss of the model, in units of the sensors' noise, with which all were last tried from all of their starts.
    loss: f64,
}

impl Default for Helpful {
    /// Nothing was tried.
    fn default() -> Self {
        Self {
            effects: Vec::new(),
            loss: f64::INFINITY,
        }
    }
}

impl Helpful {
    /// The sets with one more of these effects that are worth a fit. Those that did not help are tried again, and the others
    /// from all of their starts, once the loss has fallen far since; always if torques are compared, which takes no fit.
    pub fn with_one_more(
        &mut self,
        problem: &Problem<'_>,
        from: &Trial,
        all: Vec<FittedEffect>,
    ) -> Vec<Vec<FittedEffect>> {
        let is_anew = problem.error_model == ErrorModel::InverseDynamics
            || from.has_fallen_far(self.loss, &problem.settings.select);
        if is_anew {
            self.loss = from.loss_in_noise();
        }
        let led_to = |new: &FittedEffect| {
            let mut helpful = self.effects.iter();
            helpful.find(|led| led.joint == new.joint && led.effect.name == new.effect.name)
        };
        let starts = |new: &FittedEffect| match is_anew {
            true => Some(starts(new)),
            false => led_to(new).map(|led| vec![led.clone()]),
        };
        let starts = all.iter().filter_map(starts).collect();
        let sets = with_one_more(problem, &from.fitted, starts);
        let helpful = sets.iter().filter_map(|set| set.last().cloned());
        self.effects = helpful.collect();
        sets
    }
}
