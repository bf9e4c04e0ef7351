use rand::Rng;
use thiserror::Error;

use residyn_core::data::Log;
use residyn_core::plant::{PlantError, Rig};

/// A plant that a policy drives: a simulated rig, or a plant in another process.
pub trait Driven {
    /// A log of this plant, still without rows.
    fn empty_log(&self) -> Log;

    /// Seconds since the start at the newest reading.
    fn time_s(&self) -> f64;

    /// What the sensors say: positions, then velocities.
    fn measure(&mut self) -> Vec<f64>;

    /// The true state, positions, then velocities, or what the sensors say where nobody knows it.
    fn state(&self) -> &[f64];

    /// The torque or command to hold where no better one is known.
    fn safe(&self) -> Vec<f64>;

    /// Hold a torque or command for a step. A plant that does not wait goes on with `next`, one a step, until it is sent another
    /// command.
    ///
    /// # Errors
    /// A plant that diverges, or that no longer does what it is told.
    fn step(&mut self, command: &[f64], next: &[Vec<f64>]) -> Result<Held, DriveError>;
}

/// What became of a command.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// The command that the plant was sent, which its limits may have changed.
    pub sent: Vec<f64>,
    /// A command for each step that passed, in the order in which they act: the one that was sent alone, unless the plant did not
    /// wait for it.
    pub steps: Vec<Vec<f64>>,
}

impl Held {
    /// By a plant that waits, for one step.
    pub fn for_a_step(command: &[f64]) -> Self {
        Self {
            sent: command.to_vec(),
            steps: vec![command.to_vec()],
        }
    }
}

/// Why a plant can no longer be driven.
#[derive(Debug, Error)]
pub enum DriveError {
    #[error("{0}")]
    Rig(#[from] PlantError),
    #[error("{0}")]
    Elsewhere(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// A simulated rig and the draws of its sensors' noise.
pub struct Simulated<'d, R> {
    pub rig: Rig<'d>,
    pub noise: R,
}

impl<R: Rng> Driven for Simulated<'_, R> {
    fn empty_log(&self) -> Log {
        self.rig.empty_log()
    }

    fn time_s(&self) -> f64 {
        self.rig.time_s()
    }

    fn measure(&mut self) -> Vec<f64> {
        self.rig.measure(&mut self.noise)
    }

    fn state(&self) -> &[f64] {
        self.rig.state()
    }

    /// Nothing.
    fn safe(&self) -> Vec<f64> {
        vec![0.0; self.rig.joints()]
    }

    fn step(&mut self, command: &[f64], _: &[Vec<f64>]) -> Result<Held, DriveError> {
        self.rig.step(command)?;
        Ok(Held::for_a_step(command))
    }
}
