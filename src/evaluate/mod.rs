//! Open-loop prediction error: how far a model runs from a log that it only sees the start and the
//! torque of.

mod calibrate;
mod open_loop;
mod summary;
mod trace;

pub use calibrate::{CalibrateError, Offsets, calibrate};
pub use open_loop::{Assessment, OpenLoop, WindowError, assess, window_count};
pub use summary::{Summary, summarise};
pub use trace::{Trace, traces};
