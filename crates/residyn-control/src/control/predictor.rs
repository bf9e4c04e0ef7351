use crate::plan::Objective;
use residyn_core::model::{Dynamics, MlpWeights};
use residyn_core::sim::batch::Rollouts;
use residyn_core::sim::{Environment, Integrator};

/// A model as the planner uses it: equations with their values, networks whose outputs are added to their derivative,
/// and the integrator.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictor {
    equations: Dynamics,
    networks: Vec<MlpWeights>,
    integrator: Integrator,
    /// Steps until a command acts.
    latency: usize,
}

impl Predictor {
    /// A model of equations alone.
    pub fn of_equations(equations: Dynamics, integrator: Integrator) -> Self {
        Self::new(equations, Vec::new(), integrator)
    }

    /// Equations and the networks whose outputs are added to their derivative; `integrator` is the one that the model
    /// was trained with.
    pub fn new(equations: Dynamics, networks: Vec<MlpWeights>, integrator: Integrator) -> Self {
        Self {
            equations,
            networks,
            integrator,
            latency: 0,
        }
    }

    /// The same for a plant on which each command acts so many steps after the state was measured that it answers.
    #[must_use]
    pub fn acting_after(self, steps: usize) -> Self {
        Self {
            latency: steps,
            ..self
        }
    }

    /// Name of the system.
    pub fn system(&self) -> &str {
        &self.equations.name
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.equations.joints
    }

    /// The states of the model's effects along what is measured and commanded, if its effects have any: no sensor shows them.
    /// Networks, which do not act on them, are left out.
    pub fn observer(&self, step_s: f64) -> Option<Environment<'_>> {
        self.equations.internal.as_ref()?;
        Some(Environment::new(&self.equations, self.integrator, step_s))
    }

    /// Rollouts of the model under this objective, in steps of `step_s` seconds.
    ///
    /// # Panics
    /// When the objective has a different number of joints.
    pub fn rollouts(&self, objective: &Objective, step_s: f64) -> Rollouts {
        let (equations, objective) = (&self.equations, objective.program());
        Rollouts::new(
            equations,
            &self.networks,
            objective,
            self.integrator,
            step_s,
        )
        .acting_after(self.latency)
    }
}
