use std::f64::consts::TAU;

use residyn_core::model::Model;

use super::error::InvestigateError;

/// Bandwidth of the feedback around a reference, Hz: well below where the delays of most rigs matter, and fast enough that a
/// model that lacks friction is held to its reference.
const BANDWIDTH_HZ: f64 = 1.0;

/// Gains that hold joints to a reference, critically damped: N m/rad and N m s/rad for each joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracking {
    pub stiffness: Vec<f64>,
    pub damping: Vec<f64>,
}

impl Tracking {
    /// For the inertias that the joints of a model have at `q`.
    ///
    /// # Errors
    /// A joint that a torque does not accelerate.
    pub fn of(model: &Model, q: &[f64]) -> Result<Self, InvestigateError> {
        let inertias = model.joint_inertias_at(q);
        let moves = |inertia: &f64| inertia.is_finite() && *inertia > 0.0;
        if let Some(joint) = inertias.iter().position(|inertia| !moves(inertia)) {
            return Err(InvestigateError::NoMotor { joint: joint + 1 });
        }
        let omega = TAU * BANDWIDTH_HZ;
        let gains = |factor: f64| inertias.iter().map(|inertia| factor * inertia).collect();
        Ok(Self {
            stiffness: gains(omega.powi(2)),
            damping: gains(2.0 * omega),
        })
    }

    /// None, for a plant whose own controller follows commanded positions.
    pub fn none(joints: usize) -> Self {
        Self {
            stiffness: vec![0.0; joints],
            damping: vec![0.0; joints],
        }
    }
}
