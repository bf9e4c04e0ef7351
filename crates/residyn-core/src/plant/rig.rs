use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::PlantError;
use crate::data::{Log, Quantity};
use crate::limits::is_reading;
use crate::model::Dynamics;
use crate::sim::{Environment, Integrator};

/// A plant under control: a torque is held for a step, then the state is measured.
///
/// Its integrator may be far finer than that of the planner's model.
pub struct Rig<'d> {
    environment: Environment<'d>,
    noise: Noise,
    joints: usize,
    driven_by: Quantity,
    state: Vec<f64>,
    step_s: f64,
    steps: u32,
}

/// Standard deviations of the white noise on each measurement.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// In rad (or m).
    pub position: f64,
    /// In rad/s (or m/s).
    pub velocity: f64,
}

impl<'d> Rig<'d> {
    /// A plant from `start` (positions, then velocities) in steps of `step_s` seconds.
    ///
    /// # Panics
    /// When `start` does not have the plant's size.
    pub fn new(
        dynamics: &'d Dynamics,
        start: &[f64],
        integrator: Integrator,
        step_s: f64,
        noise: Noise,
    ) -> Self {
        assert_eq!(
            start.len(),
            2 * dynamics.joints,
            "two values for each joint"
        );
        Self {
            environment: Environment::new(dynamics, integrator, step_s),
            noise,
            joints: dynamics.joints,
            driven_by: dynamics.driven_by(),
            state: start.to_vec(),
            step_s,
            steps: 0,
        }
    }

    /// Number of its joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// The true state: positions, then velocities.
    pub fn state(&self) -> &[f64] {
        &self.state
    }

    /// A log of this plant, still without rows.
    pub fn empty_log(&self) -> Log {
        Log {
            driven_by: self.driven_by,
            ..Log::empty(self.joints)
        }
    }

    /// Seconds since the start.
    pub fn time_s(&self) -> f64 {
        f64::from(self.steps) * self.step_s
    }

    /// The measured state: positions, then velocities, with noise.
    pub fn measure(&mut self, rng: &mut impl Rng) -> Vec<f64> {
        let time_s = self.time_s();
        let shown = self.environment.angles(&self.state, time_s);
        let angles = shown.iter().map(|angle| (*angle, self.noise.position));
        let velocities = self.state[self.joints..].iter();
        angles
            .chain(velocities.map(|velocity| (*velocity, self.noise.velocity)))
            .map(|(value, deviation)| {
                let normal: f64 = StandardNormal.sample(rng);
                value + deviation * normal
            })
            .collect()
    }

    /// Hold the torques or commands `tau` for one step.
    ///
    /// # Errors
    /// A plant that diverges.
    pub fn step(&mut self, tau: &[f64]) -> Result<(), PlantError> {
        let from = self.time_s();
        self.environment.step(&mut self.state, tau, from);
        self.steps += 1;
        if self.state.iter().copied().all(is_reading) {
            return Ok(());
        }
        let time_s = self.time_s();
        Err(PlantError::Diverged { time_s })
    }
}
