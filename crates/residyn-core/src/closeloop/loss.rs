use super::fitted::Fitted;
use super::problem::Problem;
use super::select::Losses;
use crate::model::FittedEffect;

/// Losses of a model on blocks left out of its fit, in one unit for all models: a fit's own losses are in units of its
/// scale.
pub(super) struct Loss {
    losses: Losses,
    unit: f64,
}

impl Loss {
    pub fn of(problem: &Problem<'_>, model: &Fitted) -> Self {
        Self {
            losses: Losses::of(problem, model),
            unit: model.fit.scale.powi(2),
        }
    }

    pub fn total(&self) -> f64 {
        self.losses.total() * self.unit
    }

    /// The loss on the parts that an effect is judged by.
    pub fn on(&self, effect: &FittedEffect) -> f64 {
        self.losses.of_effect(effect).iter().sum::<f64>() * self.unit
    }
}
