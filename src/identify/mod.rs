//! Physical parameters from logs: least squares on trajectories in f64.
//!
//! Nothing here differentiates measured data. Windows of a log are integrated open loop from free start
//! states and compared with the logged positions; reported velocities, which are filtered or delayed on
//! most rigs, are not used.

mod fit;
mod identifiability;
mod intervals;
mod offsets;
mod sensitivity;
mod shooting;
mod values;

pub use crate::sim::{Window, cut, initial_state};
pub use fit::{Fit, FitError, Reduced, as_it_stands, fit, promise};
pub use identifiability::{Identifiability, identifiability};
pub use intervals::{BLOCK_S, Uncertainty, blocks, stretches, uncertainty};
pub use offsets::{CalibrateError, Offsets, calibrate};
pub use sensitivity::Local;
pub use shooting::{Shooting, WindowTerms};
pub use values::{Column, Own, Values};
