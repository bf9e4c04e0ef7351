//! Open-loop prediction error: how far a model that is given only the start state and the torques of a log departs from
//! it.

mod assessment;
mod open_loop;
mod summary;
mod trace;

pub use assessment::{Assessment, OpenLoop, WindowError};
pub use open_loop::{assess, window_count};
pub(crate) use open_loop::{errors_in, windows};
pub use summary::{Summary, summarise};
pub use trace::{Trace, traces};
