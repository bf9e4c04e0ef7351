//! How far a model departs from logs: open-loop prediction error, given only the start state and the torques of a log, and
//! the error of the torques that the logged motion needs.

mod assessment;
mod open_loop;
mod start_noise;
mod summary;
mod torque;
mod trace;

pub use assessment::{Assessment, OpenLoop, WindowError};
pub use open_loop::{assess, window_count};
pub use open_loop::{errors_in, windows};
pub use start_noise::error_of_starts;
pub use summary::{Summary, summarise};
pub(crate) use torque::balance_of;
pub use torque::{
    NeededTorques, TorqueError, needed_torques, torque_column, torque_error, torques_leave,
};
pub use trace::{Trace, traces};
