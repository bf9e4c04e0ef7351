use serde::{Deserialize, Serialize};

/// Points in the space of states and torques, and the torques of a rollout. Every number is exactly an f32, so that
/// clients in single precision get the same input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Samples {
    /// Number of joints n.
    pub joints: usize,
    /// In s.
    pub step_s: f64,
    /// `[point][state]`: positions, velocities, then the states of effects.
    pub states: Vec<Vec<f64>>,
    /// `[point][n]`: torques held for a step. For a step, they are commanded after zero torque; for the derivative,
    /// they act.
    pub torques: Vec<Vec<f64>>,
    /// State at the start of the rollout, at time 0 and after no torque.
    pub start: Vec<f64>,
    /// `[step][n]`: torques commanded over each step of the rollout.
    pub held: Vec<Vec<f64>>,
}
