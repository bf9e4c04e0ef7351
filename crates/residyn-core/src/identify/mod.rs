//! Physical parameters from logs: least squares in f64, on trajectories or on torques.
//!
//! On trajectories, measured data are never differentiated: windows of a log are integrated open loop from free start
//! states and compared with the logged positions. On torques, for position-controlled rigs, the smoothed motion is
//! differentiated, and the torque that it needs is compared with the logged one. Logged velocities are not used, since
//! most rigs filter or delay them.

mod active_set;
mod balance;
mod combinations;
mod distance;
mod fit;
mod identifiability;
mod intervals;
mod levenberg_marquardt;
mod normal_equations;
mod offsets;
mod outcome;
mod pack;
mod prior;
mod search;
mod sensitivity;
mod shooting;
mod solver;
mod start;
mod stiffness;
mod sums;
mod torques;
mod values;

pub use crate::sim::{Window, cut, initial_state};
pub use active_set::step_within_bounds;
pub use combinations::{
    Combination, IdentifiableBodies, Weights, distinguished, identifiable_bodies, sizes, weights,
};
pub use distance::squared_distance;
pub use fit::{as_it_stands, fit, fit_below, fit_by, led_below, predicted_cost};
pub use identifiability::{Identifiability, Open, identifiability, open};
pub(crate) use intervals::count;
pub use intervals::{BLOCK_S, Uncertainty, blocks, blocks_of_times, uncertainty};
pub use levenberg_marquardt::LevenbergMarquardt;
pub use normal_equations::{Reduced, WindowTerms, submatrix, with_unit_diagonal};
pub use offsets::{CalibrateError, Offsets, calibrate, calibrate_first};
pub use outcome::{Fit, FitError, Led, Termination};
pub use search::{Linearised, Purpose, Search, Step};
pub use sensitivity::Local;
pub use shooting::Shooting;
pub(crate) use shooting::rms_by_joint;
pub use solver::Solver;
pub use start::start_deviations;
pub use stiffness::{longest_stable_step, stable_steps};
pub use sums::huber;
pub use torques::{TorqueFit, fit_torques, has_torques};
pub(crate) use values::free_parameters;
pub use values::{Column, Own, Values};
