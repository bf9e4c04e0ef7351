//! The loop closed on control: a plant has an effect that the declared model does not know. How much of the return that
//! this costs comes back when the model is closed on the logs of one or a few episodes?
//!
//! The same planner drives the plant by the declared model, by that model with what closing the loop found, by the hybrid of
//! that model and a network, and by the plant's own equations.

mod file;
mod lab;
mod outcome;
mod runs;
mod trial;

pub use file::{Case, Experiment};
pub use lab::Lab;
pub use outcome::{Compared, Outcome, OutcomeOfCase, TARGET, WonBack};
pub use trial::{Closed, Contestant, Named, Score, Trial};
