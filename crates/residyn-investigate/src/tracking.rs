use std::f64::consts::TAU;
use std::num::NonZeroU32;

use residyn_core::model::Dynamics;
use residyn_core::sim::{Environment, Integrator};

use super::error::InvestigateError;

/// Bandwidth of the feedback around a reference, Hz: well below where the delays of most rigs matter, and fast enough that a
/// model that lacks friction is held to its reference.
const BANDWIDTH_HZ: f64 = 1.0;
/// The step over which the model's answer to a torque is looked at, s.
const INSTANT_S: f64 = 1e-4;

/// Gains that hold joints to a reference, critically damped: N m/rad and N m s/rad for each joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracking {
    pub stiffness: Vec<f64>,
    pub damping: Vec<f64>,
}

impl Tracking {
    /// For the inertias that the joints of a model have at `q`, at rest.
    ///
    /// # Errors
    /// A joint that a torque does not accelerate.
    pub fn of(dynamics: &Dynamics, q: &[f64]) -> Result<Self, InvestigateError> {
        let joints = dynamics.joints;
        let accelerated = |torque: &[f64]| {
            let mut state = [q, &vec![0.0; joints]].concat();
            Environment::new(dynamics, Integrator::fine(NonZeroU32::MIN), INSTANT_S)
                .step(&mut state, torque, 0.0);
            state.split_off(joints)
        };
        let rest = accelerated(&vec![0.0; joints]);
        let omega = TAU * BANDWIDTH_HZ;
        let inertia = |joint: usize| {
            let mut torque = vec![0.0; joints];
            torque[joint] = 1.0;
            let gained = (accelerated(&torque)[joint] - rest[joint]) / INSTANT_S;
            match gained.is_finite() && gained > f64::MIN_POSITIVE {
                true => Ok(1.0 / gained),
                false => Err(InvestigateError::NoMotor { joint: joint + 1 }),
            }
        };
        let inertias = (0..joints).map(inertia).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            stiffness: inertias
                .iter()
                .map(|inertia| inertia * omega.powi(2))
                .collect(),
            damping: inertias
                .iter()
                .map(|inertia| 2.0 * inertia * omega)
                .collect(),
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
