//! Investigations: the program designs a motion within limits, plays it on a plant, closes the loop on all that it has recorded,
//! and chooses the next motion by what is still open, until every name is established.

mod choice;
mod error;
mod follow;
mod investigation;
mod kept;
mod play;
mod region;
mod round;
mod runaway;
mod tracking;
mod within;

pub use choice::{Choice, Choose, Designed, Purpose, Random};
pub use error::InvestigateError;
pub use follow::Follow;
pub use investigation::{Ended, Investigated, Investigation, Watch};
pub use region::{Region, Span};
pub use round::{Named, Round};
pub use runaway::Runaway;
pub use tracking::{Reference, Tracking};
