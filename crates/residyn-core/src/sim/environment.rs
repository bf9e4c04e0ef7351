use super::{Commands, Hold, Integrator, Point, Simulator};
use crate::lanes::Row;

/// A model stepped like a controlled environment: a fixed step under a held torque, in f64.
///
/// A model with torque filters remembers the torques of all steps since its start; before that they were zero.
pub struct Environment<'d> {
    model: Point<'d>,
    simulator: Simulator<1>,
    integrator: Integrator,
    step_s: f64,
    past: Past,
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
    /// A model in steps of `step_s` seconds.
    pub fn new(model: impl Into<Point<'d>>, integrator: Integrator, step_s: f64) -> Self {
        let model = model.into();
        Self {
            simulator: Simulator::new(model.clone(), integrator.scheme()),
            model,
            integrator,
            step_s,
            past: Past::default(),
        }
    }

    /// Advance `state` by one step from `time_s` under the torque `tau`: positions and velocities, and the internal states
    /// if they are given, else as the last step left them.
    ///
    /// # Panics
    /// When `state` or `tau` does not have the model's size.
    pub fn step(&mut self, state: &mut [f64], tau: &[f64], time_s: f64) {
        if !self.model.dynamics.filters.is_empty() {
            self.past.push(tau, time_s, self.step_s);
        }
        let commands = Commands::new(&self.model, &self.past.time, &self.past.tau);
        let held: Vec<_> = tau.iter().map(|tau| Row([*tau])).collect();
        self.simulator.place(state);
        self.simulator.advance(&Hold::lasting(
            [&commands],
            &held,
            Row([time_s]),
            self.step_s,
            self.integrator.substeps(),
        ));
        for (value, Row([moved])) in state.iter_mut().zip(&self.simulator.state) {
            *value = *moved;
        }
    }

    /// The internal states as the last step left them; before the first as before a log.
    pub fn internal(&self) -> Vec<f64> {
        let internal = &self.simulator.state[self.model.dynamics.layout().internal()];
        internal.iter().map(|Row([value])| *value).collect()
    }

    /// The angles that sensors show of `state` at the end of the last step, or before the first, at `time_s`.
    pub fn angles(&mut self, state: &[f64], time_s: f64) -> Vec<f64> {
        self.simulator.place(state);
        let shown = self.simulator.angles_at(Row([time_s]));
        shown.iter().map(|Row([angle])| *angle).collect()
    }

    /// The torque that acted on each joint at the end of the last step; 0 before the first.
    pub fn acting(&self) -> Vec<f64> {
        let acting = self.simulator.acting();
        acting.into_iter().map(|Row([tau])| tau).collect()
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

#[cfg(test)]
mod tests {

    use super::Environment;
    use crate::data::Joint;
    use crate::model::Library;
    use crate::plant::Plant;
    use crate::sim::Integrator;

    #[test]
    fn a_delay_of_whole_steps_is_the_torque_of_so_many_steps_before() {
        let library = Library::built_in();
        let mut plant = Plant::of_system(library.model("pendulum").unwrap());
        let plain = plant.dynamics();
        let torques = [1.0, -2.0, 3.0, 0.5, -1.5, 2.0];
        let delay = ("d".to_owned(), 0.04);
        plant
            .add_effect(&library, "actuator_delay", Joint::at(0), &[delay])
            .unwrap();
        let late = plant.dynamics();
        let steps = 4.try_into().unwrap();
        for integrator in [Integrator::SEMI_IMPLICIT_EULER, Integrator::fine(steps)] {
            let mut delayed = Environment::new(&late, integrator, 0.02);
            let mut shifted = Environment::new(&plain, integrator, 0.02);
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
