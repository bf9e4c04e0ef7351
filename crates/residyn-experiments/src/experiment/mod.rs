//! The published experiments: how much data a model needs until planning with it is as good as planning with the plant's
//! own equations; and [`undeclared_effect`]: how much of the return closing the loop recovers.

mod config;
mod error;
mod learning;
mod offline_prior;
mod physics_prior;
mod picture;
mod pieces;
mod published;
mod receding_horizon;
mod results;
mod session;
pub mod undeclared_effect;

pub use config::{Config, MethodConfig};
pub use error::ExperimentError;
pub use learning::{FinishedRound, Observer};
pub use picture::picture;
pub use published::{EXPERIMENTS, Experiment};
pub use results::{Course, PERFECT, PRIOR, Reached, Results};
pub use session::Session;
