//! The published experiments: what a model must see of a plant before planning with it is worth as much as planning
//! with the plant's own equations; and one more, [`undeclared_effect`]: what of that the closed loop finds by itself.

mod config;
mod error;
mod learning;
mod offline_prior;
mod physics_prior;
mod picture;
mod receding_horizon;
mod results;
mod session;
pub mod undeclared_effect;

pub use config::{Config, MethodConfig};
pub use error::ExperimentError;
pub use learning::Step;
pub use picture::picture;
pub use results::{Course, PERFECT, PRIOR, Reached, Results};
pub use session::{Experiment, Observer, Session};
