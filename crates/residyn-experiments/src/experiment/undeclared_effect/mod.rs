//! Closing the loop for control: a plant has an effect that the declared model lacks. How much of the lost return does
//! closing the loop on the logs of one or a few episodes recover?
//!
//! The same planner drives the plant with the declared model, with the model that closing the loop gives, with a hybrid of
//! the declared model and a network, and with the plant's own equations.

mod file;
mod results;
mod runs;
mod session;
mod trial;

pub use file::{Case, Experiment};
pub use results::{CaseResults, Compared, Recovered, Results, TARGET};
pub use session::Session;
pub use trial::{Closed, ModelScore, NamedEffect, PlanningModel, Trial};
