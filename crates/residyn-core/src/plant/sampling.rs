use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::file::{Plant, PlantError};
use crate::data::Trajectory;
use crate::limits::{LOG_TIME, SAMPLED_STEPS, check_readings, is_reading};
use crate::sim::{Environment, Integrator};

/// Random trajectories of a plant with its exact states: starts uniform in the ranges, a new torque
/// uniform in its range at every step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    pub trajectories: usize,
    /// Steps of each; 1 gives transitions that are independent of each other.
    pub length: usize,
    pub step_s: f64,
    pub integrator: Integrator,
    /// Ranges of the start, one per joint, in rad (or m).
    pub position: Vec<[f64; 2]>,
    /// As above, for velocities.
    pub velocity: Vec<[f64; 2]>,
    /// As above, for torques, in N m (or N).
    #[serde(alias = "command")]
    pub torque: Vec<[f64; 2]>,
    pub starts: Starts,
}

/// How the starts of trajectories are related.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Starts {
    /// Each is drawn independently.
    #[default]
    Independent,
    /// Every second one repeats the one before, torques included, with reversed velocities. Odd functions of the
    /// velocities, such as friction, are then uncorrelated with torques and positions.
    Mirrored,
}

/// The start of one trajectory (positions, then velocities) and its torques, `[step][joint]`.
#[derive(Clone)]
struct Draw {
    state: Vec<f64>,
    torque: Vec<Vec<f64>>,
}

impl Plant {
    /// Draw random trajectories.
    ///
    /// # Errors
    /// Ranges that do not match the plant's joints, a plant that diverges, or one whose model reads measured columns.
    pub fn sample(
        &self,
        sampling: &Sampling,
        rng: &mut impl Rng,
    ) -> Result<Vec<Trajectory>, PlantError> {
        sampling
            .check(self.system.joints)
            .map_err(PlantError::Sampling)?;
        self.check_measured()?;
        let dynamics = self.dynamics();
        if !dynamics.filters.is_empty() {
            return Err(PlantError::Sampling(
                "the plant has an effect with memory, but random trajectories start without a past; leave the \
                 effect out, or train on logs that `residyn simulate` wrote"
                    .into(),
            ));
        }
        let mut environment = Environment::new(&dynamics, sampling.integrator, sampling.step_s);
        let mut run = |draw: Draw| sampling.run(draw, &mut environment);
        (sampling.draws(rng).into_iter())
            .map(|draw| run(draw).map_err(|time_s| self.diverged(time_s)))
            .collect()
    }
}

impl Sampling {
    fn check(&self, joints: usize) -> Result<(), String> {
        let ranges = [
            ("position", &self.position),
            ("velocity", &self.velocity),
            ("torque", &self.torque),
        ];
        for (name, ranges) in ranges {
            if ranges.len() != joints {
                let found = ranges.len();
                return Err(format!(
                    "`{name}` needs a range [lowest, highest] for each of {joints} joints, found {found}"
                ));
            }
            if let Some(bad) = ranges.iter().find(|[low, high]| !(low <= high)) {
                return Err(format!(
                    "`{name}` has the range {bad:?}; write [lowest, highest]"
                ));
            }
            check_readings(name, ranges.iter().flatten().copied())?;
        }
        check_step(self.step_s)?;
        if self.trajectories == 0 || self.length == 0 {
            return Err("`trajectories` and `length` must be at least 1".to_owned());
        }
        let steps = self.trajectories.saturating_mul(self.length);
        if steps > SAMPLED_STEPS {
            return Err(format!(
                "`trajectories` times `length` is {steps} steps; at most {SAMPLED_STEPS} are sampled"
            ));
        }
        Ok(())
    }

    fn draws(&self, rng: &mut impl Rng) -> Vec<Draw> {
        let mut draws: Vec<Draw> = Vec::with_capacity(self.trajectories);
        for k in 0..self.trajectories {
            let draw = match (self.starts, draws.last()) {
                (Starts::Mirrored, Some(last)) if k % 2 == 1 => last.clone().mirrored(),
                _ => Draw {
                    state: [&self.position, &self.velocity]
                        .map(|ranges| uniform(ranges, rng))
                        .concat(),
                    torque: (0..self.length)
                        .map(|_| uniform(&self.torque, rng))
                        .collect(),
                },
            };
            draws.push(draw);
        }
        draws
    }

    /// The error is the time at which the state is no longer finite \[s\].
    fn run(&self, draw: Draw, environment: &mut Environment) -> Result<Trajectory, f64> {
        let mut state = draw.state;
        let mut trajectory = Trajectory {
            time: vec![0.0],
            states: state.clone(),
            inputs: Vec::new(),
        };
        for (tau, step) in draw.torque.iter().zip(1u32..) {
            let from = trajectory.time[trajectory.time.len() - 1];
            environment.step(&mut state, tau, from);
            let time = f64::from(step) * self.step_s;
            if !state.iter().copied().all(is_reading) {
                return Err(time);
            }
            trajectory.time.push(time);
            trajectory.states.extend(&state);
            trajectory.inputs.extend(tau);
        }
        // No torque acts after the last row.
        trajectory.inputs.extend(vec![0.0; state.len() / 2]);
        Ok(trajectory)
    }
}

impl Draw {
    fn mirrored(mut self) -> Self {
        let joints = self.state.len() / 2;
        for velocity in &mut self.state[joints..] {
            *velocity = -*velocity;
        }
        self
    }
}

/// Refuse an invalid step length \[s\].
pub fn check_step(step_s: f64) -> Result<(), String> {
    match step_s > 0.0 && step_s <= LOG_TIME {
        true => Ok(()),
        false => Err(format!(
            "`step_s` is {step_s:?}; it must be above zero, and at most {LOG_TIME:e}"
        )),
    }
}

fn uniform(ranges: &[[f64; 2]], rng: &mut impl Rng) -> Vec<f64> {
    ranges
        .iter()
        .map(|[low, high]| rng.random_range(*low..=*high))
        .collect()
}

#[cfg(test)]
mod tests {

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Sampling, Starts};
    use crate::model::Library;
    use crate::plant::Plant;
    use crate::sim::Integrator;

    fn sampling() -> Sampling {
        Sampling {
            trajectories: 3,
            length: 2,
            step_s: 0.02,
            integrator: Integrator::SEMI_IMPLICIT_EULER,
            position: vec![[-1.0, 1.0]],
            velocity: vec![[-8.0, 8.0]],
            torque: vec![[-3.0, 3.0]],
            starts: Starts::Mirrored,
        }
    }

    #[test]
    fn a_mirrored_start_differs_in_the_sign_of_its_velocity_alone() {
        let plant = Plant::of_system(Library::built_in().model("pendulum").unwrap());
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn = plant.sample(&sampling(), &mut rng).unwrap();
        let [first, second, third] = drawn.as_slice() else {
            panic!("three were asked for")
        };
        assert_eq!(first.states[..2], [second.states[0], -second.states[1]]);
        assert_eq!(first.inputs, second.inputs);
        assert_ne!(first.inputs, third.inputs);
        assert_eq!(first.time, [0.0, 0.02, 0.04]);
        // v' = v + h (15 sin q + 3 tau), q' = q + h v'
        let (q, v, tau) = (first.states[0], first.states[1], first.inputs[0]);
        let next = v + 0.02 * (15.0 * q.sin() + 3.0 * tau);
        assert!((first.states[3] - next).abs() < 1e-12);
        assert!((first.states[2] - (q + 0.02 * next)).abs() < 1e-12);
    }

    #[test]
    fn ranges_that_do_not_suit_the_rig_are_refused() {
        let plant = Plant::of_system(Library::built_in().model("acrobot").unwrap());
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let message = plant.sample(&sampling(), &mut rng).unwrap_err().to_string();
        assert_eq!(
            message,
            "`position` needs a range [lowest, highest] for each of 2 joints, found 1"
        );
    }
}
