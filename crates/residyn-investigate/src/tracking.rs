use std::f64::consts::TAU;

use residyn_core::model::{InverseDynamics, Model};

use super::error::InvestigateError;

/// Bandwidth of the feedback around a reference, Hz: well below where the delays of most rigs matter, and fast enough that a
/// model that lacks friction is held to its reference.
const BANDWIDTH_HZ: f64 = 1.0;

/// Where all joints are to be, how fast they are to move, and how to accelerate.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub qdd: Vec<f64>,
    /// What drives the model so: torques or commands.
    pub driven_by: Vec<f64>,
}

/// What holds a rig to a reference.
pub enum Tracking {
    /// Torques that the model needs where the rig is, to accelerate all joints together as the reference does and back to it,
    /// critically damped: on an arm the correction of one joint alone would throw the light links after it about (computed torque;
    /// Siciliano et al., Robotics, section 8.5.2). Friction acts as at the reference's speed, which has no noise.
    Torques(InverseDynamics),
    /// The plant's own controller, which follows commanded positions.
    Plant,
}

impl Tracking {
    /// With the torques of a model that moves near `q`.
    ///
    /// # Errors
    /// A joint that a torque does not accelerate.
    pub fn of(model: &Model, q: &[f64]) -> Result<Self, InvestigateError> {
        let inverse = model.inverse_dynamics();
        let moves = |of: &f64| of.is_finite() && *of > 0.0;
        let (_, mobility) = inverse.forward(q, &vec![0.0; q.len()]);
        match mobility.diagonal().iter().position(|of| !moves(of)) {
            Some(joint) => Err(InvestigateError::NoMotor { joint: joint + 1 }),
            None => Ok(Self::Torques(inverse)),
        }
    }

    /// What drives the rig where it is at rest at a `start`, and moves as `to` on the way there; `None` where the model gives no
    /// torques.
    pub fn on_the_way(&self, to: &Reference, start: &Reference) -> Option<Vec<f64>> {
        match self {
            Self::Torques(inverse) => inverse.torques(&to.q, &to.qd, &to.qdd),
            Self::Plant => {
                let all = start.driven_by.iter().zip(&to.q).zip(&start.q);
                Some(all.map(|((driven, q), start)| driven + q - start).collect())
            }
        }
    }

    /// What to command in a measured state; `None` where the model gives no torques.
    pub fn command(&self, to: &Reference, q: &[f64], qd: &[f64]) -> Option<Vec<f64>> {
        let Self::Torques(inverse) = self else {
            return Some(to.driven_by.clone());
        };
        let omega = TAU * BANDWIDTH_HZ;
        let back = |joint: usize| {
            let lags = [to.q[joint] - q[joint], to.qd[joint] - qd[joint]];
            to.qdd[joint] + omega.powi(2) * lags[0] + 2.0 * omega * lags[1]
        };
        let back: Vec<f64> = (0..q.len()).map(back).collect();
        let here = inverse.torques(q, &to.qd, &back)?;
        let there = inverse.torques(&to.q, &to.qd, &to.qdd)?;
        let all = to.driven_by.iter().zip(here).zip(there);
        Some(
            all.map(|((driven, here), there)| driven + here - there)
                .collect(),
        )
    }
}
