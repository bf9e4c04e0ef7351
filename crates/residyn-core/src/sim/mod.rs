//! Simulation: moving a model through time, shared by fits, errors, simulated rigs and planners.

pub mod batch;
mod command;
mod environment;
mod integrator;
mod internal;
pub mod metric;
mod objective;
mod point;
mod scheme;
mod sensors;
mod simulator;
mod stepper;
mod substeps;
mod window;

pub use command::{Commands, Mean, StepTorque};
pub use environment::Environment;
pub use integrator::{Integrator, IntegratorError};
#[cfg(test)]
pub(crate) use internal::tests::bristles;
pub use internal::{Case, Course, InternalRates, InternalStart, LoggedMotion, internal_along};
pub use objective::Objective;
pub use point::Point;
pub use scheme::{RK4, SCHEMES, SEMI_IMPLICIT_EULER, STABILISED_RK3, Scheme, Stage};
pub use sensors::{Sensors, motions, with_own_angles};
pub use simulator::{Hold, Simulator};
pub use stepper::Stepper;
pub use substeps::{FINE_FIT_S, FIT_S, PREDICTION_S, RIG_S, Steps, substeps};
pub use window::{Window, cut, initial_state};
