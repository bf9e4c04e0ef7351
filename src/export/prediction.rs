use super::{Answers, Samples};
use crate::model::Dynamics;
use crate::sim::{Environment, Integrator};

/// A whole model, networks included, and how it is stepped: what this program itself predicts, in f64.
#[derive(Debug, Clone)]
pub(super) struct Prediction {
    pub whole: Dynamics,
    pub integrator: Integrator,
    /// In s.
    pub step_s: f64,
}

impl Prediction {
    pub fn answers(&self, samples: &Samples) -> Answers {
        let points = || samples.states.iter().zip(&samples.torques);
        let next = points().map(|(state, tau)| {
            let mut state = state.clone();
            self.environment().step(&mut state, tau, 0.0);
            state
        });
        let values = self.whole.values();
        let derivative = points().map(|(state, tau)| {
            let inputs = [state.as_slice(), tau, &[0.0], &values].concat();
            self.whole.program.eval(&inputs)
        });
        Answers {
            next: Some(next.collect()),
            derivative: Some(derivative.collect()),
            rollout: Some(self.rollout(&samples.start, &samples.held)),
        }
    }

    /// The state after each step from `start` under torques `held`.
    pub fn rollout(&self, start: &[f64], held: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let (mut environment, mut state) = (self.environment(), start.to_vec());
        let steps = held.iter().enumerate().map(|(k, tau)| {
            environment.step(&mut state, tau, k as f64 * self.step_s);
            state.clone()
        });
        steps.collect()
    }

    /// After no torque.
    fn environment(&self) -> Environment<'_> {
        Environment::new(&self.whole, self.integrator, self.step_s)
    }
}
