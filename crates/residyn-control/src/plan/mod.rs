//! Sampling-based planning: searches for the input sequence with the highest return within bounds. Planners do not know
//! the dynamics; an [`Evaluate`] computes the return of a candidate sequence.
//!
//! A method of your own is a [`Search`]: how a population updates the distribution of the next one. Here it keeps the
//! best candidate, and otherwise searches at random:
//!
//! ```
//! # use residyn_core::sim::batch::Rows;
//! use residyn_control::plan::{Evaluate, Planner, Population, Proposal, Search, Size};
//!
//! struct RandomShooting;
//!
//! impl Search for RandomShooting {
//!     fn learn(&self, population: &Population<'_>, proposal: &mut Proposal) {
//!         let best = population.elite(1);
//!         proposal.keep(best.iter().map(|(_, candidate)| population.sequence(*candidate)).collect());
//!     }
//! }
//!
//! # struct NearHalf;
//! # impl Evaluate for NearHalf {
//! #     type Start = ();
//! #     fn returns(&mut self, (): &(), inputs: &[Rows], returns: &mut Rows) {
//! #         for lane in 0..returns.len() {
//! #             returns[lane] = -inputs.iter().map(|row| (row[lane] - 0.5).abs()).sum::<f32>();
//! #         }
//! #     }
//! # }
//! let size = Size { population: 200, iterations: 5, horizon: 2 };
//! let bounds = [[-1.0, 1.0]]; // one input; the return falls with its distance from 0.5
//! let search = std::sync::Arc::new(RandomShooting);
//! let planner = Planner::by(search, size, &bounds, || NearHalf, &residyn_core::rng(0));
//! let plan = planner.plan(());
//! assert!(plan.inputs.iter().all(|step| (step[0] - 0.5).abs() < 0.2), "{plan:?}");
//! ```
//!
//! [`Controller`](crate::control::Controller) executes such a planner's plans with a model.

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
pub use method::Search;
pub use model::Start;
pub use mppi::Mppi;
pub use noise::Noise;
pub use planner::{Evaluate, Plan, Planner};
pub use population::Population;
pub use proposal::Proposal;
pub use residyn_core::sim::Objective;
pub use settings::{Method, Settings, Size};
