//! Optimal excitation: motions that a rig can follow within its limits and that determine a model's parameters, and tell its
//! alternatives apart, best.

mod balance;
mod bounds;
mod clearance;
mod criterion;
mod descent;
mod design;
mod error;
mod fourier;
mod limits;
mod logged;
mod motion;
mod parameters;
mod picture;
mod problem;
mod record;

pub use bounds::Use;
pub use criterion::{Criterion, log_condition, log_determinant};
pub use design::{
    Compared, Design, Designer, Drives, Expected, Judged, Progress, Settings, design,
};
pub use error::ExciteError;
pub use limits::{Cuboid, JointLimits, Limits, Sphere};
pub use logged::{Collinear, Excitation, GravitySweep, NextRun, OneWay, excitation};
pub use parameters::Sum;
pub use picture::picture;
