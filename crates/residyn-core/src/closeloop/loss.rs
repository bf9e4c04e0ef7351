use super::fitted::Fitted;
use super::problem::Problem;
use super::select::Losses;
use crate::model::FittedEffect;

/// Losses of a model on stretches left out of its fit, in one unit for all models: a fit's own is its scale.
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

    /// Of what an effect is judged by.
    pub fn on(&self, effect: &FittedEffect) -> f64 {
        self.losses.of_effect(effect).iter().sum::<f64>() * self.unit
    }
}
