//! Sampling-based planning: searches for the input sequence with the highest return within bounds. Planners do not know
//! the dynamics; an [`Evaluate`] computes the return of a candidate sequence.

mod cem;
mod gaussian;
mod icem;
mod limits;
mod method;
mod model;
mod mppi;
mod noise;
mod planner;
mod population;
mod proposal;
mod settings;

#[cfg(test)]
mod tests;

pub use cem::Cem;
pub use icem::Icem;
pub use limits::SettingsError;
pub use model::{Prepared, Start};
pub use mppi::Mppi;
pub use planner::{Evaluate, Plan, Planner};
pub use residyn_core::sim::Objective;
pub use settings::{Method, Settings};
