use crate::model::Integrator;

/// An explicit Runge-Kutta method whose stages each need the one before alone, as numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scheme {
    /// Equal parts of a step, each by the method.
    pub substeps: usize,
    /// For each stage the part of the substep at which it stands, reached with the rates of the stage before, and the
    /// weight of its rates.
    pub stages: &'static [(f32, f32)],
    /// Whether positions then move by the velocities' gain, too.
    pub semi_implicit: bool,
}

impl Scheme {
    pub(super) fn of(integrator: Integrator) -> Self {
        const RK4: &[(f32, f32)] = &[
            (0.0, 1.0 / 6.0),
            (0.5, 1.0 / 3.0),
            (0.5, 1.0 / 3.0),
            (1.0, 1.0 / 6.0),
        ];
        let (substeps, stages) = match integrator {
            Integrator::SemiImplicitEuler => (1, [(0.0, 1.0)].as_slice()),
            Integrator::Rk4 => (1, RK4),
            Integrator::Fine { steps } => (steps.get() as usize, RK4),
        };
        Self {
            substeps,
            stages,
            semi_implicit: integrator == Integrator::SemiImplicitEuler,
        }
    }
}
