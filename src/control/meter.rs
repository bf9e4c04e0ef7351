use crate::expr::{FormulaError, Program};
use crate::plan::Objective;

/// A formula of state, torque and time, evaluated point by point in f64.
#[derive(Debug, Clone)]
pub struct Meter {
    program: Program,
}

impl Meter {
    /// Its inputs are named as in an [`Objective`] of as many joints.
    ///
    /// # Errors
    /// An invalid formula, or an unknown name.
    pub fn new(formula: &str, joints: usize) -> Result<Self, FormulaError> {
        Ok(Self::of(&Objective::new(formula, joints)?))
    }

    /// The reward.
    pub fn of(objective: &Objective) -> Self {
        Self {
            program: objective.program().clone(),
        }
    }

    /// Its value at `state` (positions, then velocities) after `tau` was held, at `time_s`.
    ///
    /// # Panics
    /// When `state` or `tau` has another number of joints.
    pub fn read(&self, state: &[f64], tau: &[f64], time_s: f64) -> f64 {
        let inputs = [state, tau, &[time_s]].concat();
        self.program.eval(&inputs)[0]
    }
}
