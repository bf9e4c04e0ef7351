//! Open-loop prediction error: how far a model that is given only the start state and the torques of a log departs from
//! it.

mod assessment;
mod open_loop;
mod summary;
mod trace;

pub use assessment::{Assessment, OpenLoop, WindowError};
pub(crate) use open_loop::windows;
pub use open_loop::{assess, window_count};
pub use summary::{Summary, summarise};
pub use trace::{Trace, traces};
