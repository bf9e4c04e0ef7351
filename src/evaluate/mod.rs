//! Open-loop prediction error: how far a model runs from a log that it only sees the start and the
//! torque of.

mod assessment;
mod calibrate;
mod open_loop;
mod summary;
mod trace;

pub use assessment::{Assessment, OpenLoop, WindowError};
pub use calibrate::{CalibrateError, Offsets, calibrate};
pub use open_loop::{assess, window_count};
pub use summary::{Summary, summarise};
pub use trace::{Trace, traces};
