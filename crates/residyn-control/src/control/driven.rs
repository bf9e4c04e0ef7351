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

    /// Hold a torque or command for a step; returns the one that the plant was sent, which its limits may have changed.
    ///
    /// # Errors
    /// A plant that diverges, or that no longer does what it is told.
    fn step(&mut self, command: &[f64]) -> Result<Vec<f64>, DriveError>;

    /// Steps beyond one that passed in the last step, since the plant does not wait for a command.
    fn late(&self) -> usize {
        0
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

    fn step(&mut self, command: &[f64]) -> Result<Vec<f64>, DriveError> {
        self.rig.step(command)?;
        Ok(command.to_vec())
    }
}
