use crate::expr::Tape;
use crate::lanes::Row;
use crate::model::{Commands, Dynamics, Integrator, Rollout, StepTorque};

/// A model that is stepped as a controlled environment is: a fixed step under a held torque, in f64.
///
/// The steps are those of [`Integrator`], which does the same on tensors: what a model is trained on and
/// what it is trained through must not differ. A model whose torques are filtered remembers those of all steps
/// since its beginning, before which they were zero.
pub struct Environment<'d> {
    dynamics: &'d Dynamics,
    values: Vec<f64>,
    method: Method<'d>,
    step_s: f64,
    past: Past,
    /// `[part * n + joint]`: the torque that acts in each part of a step, or in all of it.
    acting: Vec<Row<f64, 1>>,
}

enum Method<'d> {
    SemiImplicitEuler(Tape<'d, f64, 1>),
    RungeKutta {
        rollout: Rollout<'d, f64, 1>,
        substeps: usize,
    },
}

/// The torques held so far.
#[derive(Default)]
struct Past {
    /// When each began, in s.
    time: Vec<f64>,
    /// `[joint][row]`
    tau: Vec<Vec<f64>>,
}

impl<'d> Environment<'d> {
    /// `dynamics` with parameters `values`, in its order, in steps of `step_s` seconds.
    ///
    /// # Panics
    /// When `values` has not one entry a parameter.
    pub fn new(
        dynamics: &'d Dynamics,
        values: &[f64],
        integrator: Integrator,
        step_s: f64,
    ) -> Self {
        let runge_kutta = |substeps: usize| Method::RungeKutta {
            rollout: Rollout::new(dynamics, values),
            substeps,
        };
        Self {
            dynamics,
            values: values.to_vec(),
            method: match integrator {
                Integrator::SemiImplicitEuler => Method::SemiImplicitEuler(tape(dynamics, values)),
                Integrator::Rk4 => runge_kutta(1),
                Integrator::Fine { steps } => runge_kutta(steps.get() as usize),
            },
            step_s,
            past: Past::default(),
            acting: Vec::new(),
        }
    }

    /// Advance `state` (positions, then velocities) by one step from `time_s` under the torque `tau`.
    ///
    /// # Panics
    /// When `state` or `tau` is not of the model's size.
    pub fn step(&mut self, state: &mut [f64], tau: &[f64], time_s: f64) {
        self.hold(tau, time_s);
        match &mut self.method {
            Method::SemiImplicitEuler(tape) => {
                semi_implicit(tape, state, &self.acting, time_s, self.step_s);
            }
            Method::RungeKutta { rollout, substeps } => {
                let mut lanes: Vec<_> = state.iter().map(|x| Row([*x])).collect();
                let (time, step) = (Row([time_s]), Row([self.step_s]));
                rollout.advance(&mut lanes, &self.acting, time, step, *substeps);
                for (value, Row([lane])) in state.iter_mut().zip(lanes) {
                    *value = lane;
                }
            }
        }
    }

    /// The torque of each joint that acted at the end of the last step, 0 before the first.
    pub fn acting(&self) -> Vec<f64> {
        let n = self.dynamics.joints;
        match self.acting.len().checked_sub(n) {
            Some(last) => self.acting[last..].iter().map(|Row([tau])| *tau).collect(),
            None => vec![0.0; n],
        }
    }

    /// What acts while `tau` is held from `time_s` on.
    fn hold(&mut self, tau: &[f64], time_s: f64) {
        let held: Vec<_> = tau.iter().map(|tau| Row([*tau])).collect();
        if self.dynamics.filters.is_empty() {
            self.acting = held;
            return;
        }
        self.past.push(tau, time_s, self.step_s);
        let Past { time, tau } = &self.past;
        let commands = Commands::new(self.dynamics, &self.values, time, tau);
        let ends = [time_s, time_s + self.step_s].map(|time| Row([time]));
        let parts = match self.method {
            Method::SemiImplicitEuler(_) => 1,
            Method::RungeKutta { substeps, .. } => substeps,
        };
        self.acting = StepTorque::new([&commands], &held, ends[0], ends[1], parts).mean;
    }
}

impl Past {
    fn push(&mut self, tau: &[f64], time_s: f64, step_s: f64) {
        if self.time.is_empty() {
            self.time.push(time_s - step_s);
            self.tau = vec![vec![0.0]; tau.len()];
        }
        self.time.push(time_s);
        for (past, tau) in self.tau.iter_mut().zip(tau) {
            past.push(*tau);
        }
    }
}

fn tape<'d>(dynamics: &'d Dynamics, values: &[f64]) -> Tape<'d, f64, 1> {
    let expected = dynamics.parameters.len();
    assert_eq!(values.len(), expected, "one value for each parameter");
    let mut tape = dynamics.program.tape();
    let first = 3 * dynamics.joints + 1;
    for (slot, value) in tape.inputs()[first..].iter_mut().zip(values) {
        *slot = Row([*value]);
    }
    tape
}

/// v' = v + h f_v, q' = q + h (f_q + h f_v)
fn semi_implicit(
    tape: &mut Tape<f64, 1>,
    state: &mut [f64],
    tau: &[Row<f64, 1>],
    time_s: f64,
    step_s: f64,
) {
    let joints = tau.len();
    let states = state.iter().map(|x| Row([*x]));
    let inputs = states.chain(tau.iter().copied()).chain([Row([time_s])]);
    for (slot, value) in tape.inputs()[..=3 * joints].iter_mut().zip(inputs) {
        *slot = value;
    }
    tape.run();
    for j in 0..joints {
        let gain = step_s * tape.output(joints + j)[0];
        state[j] += step_s * (tape.output(j)[0] + gain);
        state[joints + j] += gain;
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::Environment;
    use crate::model::{Integrator, Library};
    use crate::plant::Plant;

    #[test]
    fn a_delay_of_whole_steps_is_the_torque_of_so_many_steps_before() {
        let library = Library::built_in();
        let mut plant = Plant::read(Path::new("pendulum"), &library).unwrap();
        let plain = plant.dynamics();
        let torques = [1.0, -2.0, 3.0, 0.5, -1.5, 2.0];
        let delay = ("d".to_owned(), 0.04);
        plant
            .add_effect(&library, "actuator_delay", 1, &[delay])
            .unwrap();
        let (late, values) = (plant.dynamics(), plant.values());
        let steps = 4.try_into().unwrap();
        for integrator in [Integrator::SemiImplicitEuler, Integrator::Fine { steps }] {
            let mut delayed = Environment::new(&late, &values, integrator, 0.02);
            let mut shifted = Environment::new(&plain, &plain.values(), integrator, 0.02);
            let (mut a, mut b) = ([3.0, 0.1], [3.0, 0.1]);
            for k in 0..torques.len() {
                let time_s = 0.02 * k as f64;
                let before = k.checked_sub(2).map_or(0.0, |k| torques[k]);
                delayed.step(&mut a, &[torques[k]], time_s);
                shifted.step(&mut b, &[before], time_s);
                assert!(
                    (0..2).all(|i| (a[i] - b[i]).abs() < 1e-9),
                    "{k}: {a:?} {b:?}"
                );
                assert!((delayed.acting()[0] - before).abs() < 1e-9);
            }
        }
    }
}
