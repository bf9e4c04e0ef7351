//! Open-loop prediction error: how far a model runs from a log that it only sees the start and the
//! torque of.

mod open_loop;
mod summary;

pub use open_loop::{Assessment, OpenLoop, WindowError, assess};
pub use summary::{Summary, summarise};
