//! Planning: searches for the best sequence of inputs. It knows an objective and what may be commanded, and asks
//! somebody else what a sequence brings.

mod cem;
mod gaussian;
mod icem;
mod method;
mod model;
mod mppi;
mod noise;
mod objective;
mod planner;
mod population;
mod proposal;
mod settings;

#[cfg(test)]
mod tests;

pub use cem::Cem;
pub use icem::Icem;
pub use model::{Prepared, Start};
pub use mppi::Mppi;
pub use objective::Objective;
pub use planner::{Evaluate, Plan, Planner};
pub use settings::{Method, Settings};
