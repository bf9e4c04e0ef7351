use super::{Predictions, Samples};
use residyn_core::model::{Dynamics, MlpWeights, NetworkError, with_residual};
use residyn_core::sim::{Environment, Integrator};

/// A whole model, networks included, and how it is stepped: the program's own predictions, in f64.
#[derive(Debug, Clone)]
pub(crate) struct ReferenceModel {
    pub whole: Dynamics,
    pub integrator: Integrator,
    /// In s.
    pub step_s: f64,
}

impl ReferenceModel {
    /// Equations with the outputs of these networks added.
    ///
    /// # Errors
    /// A network that does not fit the number of joints.
    pub fn new<'n>(
        equations: Dynamics,
        mut networks: impl Iterator<Item = &'n MlpWeights>,
        integrator: Integrator,
        step_s: f64,
    ) -> Result<Self, NetworkError> {
        let whole = networks.try_fold(equations, |dynamics, network| {
            with_residual(&dynamics, network)
        })?;
        Ok(Self {
            whole,
            integrator,
            step_s,
        })
    }

    /// Steps, derivatives and the rollout of the samples.
    pub fn predict(&self, samples: &Samples) -> Predictions {
        let points = || samples.states.iter().zip(&samples.torques);
        let next = points().map(|(state, tau)| {
            let mut state = state.clone();
            self.environment().step(&mut state, tau, 0.0);
            state
        });
        let values = self.whole.values();
        let derivative = points().map(|(state, tau)| self.whole.rates(state, tau, &values));
        Predictions {
            next: Some(next.collect()),
            derivative: Some(derivative.collect()),
            rollout: Some(self.rollout(&samples.start, &samples.held)),
        }
    }

    /// The state after each step from `start` under the torques `held`.
    pub fn rollout(&self, start: &[f64], held: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let (mut environment, mut state) = (self.environment(), start.to_vec());
        let steps = held.iter().enumerate().map(|(k, tau)| {
            environment.step(&mut state, tau, k as f64 * self.step_s);
            state.clone()
        });
        steps.collect()
    }

    /// At rest: no torque has been commanded so far.
    fn environment(&self) -> Environment<'_> {
        Environment::new(&self.whole, self.integrator, self.step_s)
    }
}
