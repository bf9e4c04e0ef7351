//! Stage 5: whether the residuals are more than noise, what they depend on, and what they look like.

mod curve;
mod force;
mod measured_probes;
mod omnibus;
mod proposal;
mod residual;
mod torque_noise;
mod unexplained;

pub use self::curve::Curve;
pub use self::force::ForceSample;
pub(super) use self::force::residual_force;
pub use self::omnibus::Omnibus;
pub use self::proposal::{Proposal, proposal};
pub use self::residual::ResidualForce;
pub(super) use self::unexplained::diagnose_in_parts;
pub use self::unexplained::{Probed, UNKNOWN, Unexplained, diagnose, unexplained};
