//! Logs of mechanical rigs in memory: columns, audit, statistics.
//!
//! A [`Log`] is one trajectory: times, joint angles, joint velocities and joint torques, in s, rad, rad/s and N m.
//! [`Log::of_table`] makes it from named columns and rejects what it cannot read with an error that names place, column
//! and remedy; numbers are never repaired. [`audit`] measures the quality of a log (sampling, noise, spikes, lags,
//! excitation) and puts what matters for fitting a model into plain sentences.
//!
//! The torque of row `i` acts from `time[i]` to `time[i + 1]` (zero-order hold).

mod audit;
mod channels;
mod clocks;
mod column;
mod columns;
mod direction;
mod dropped;
mod error;
mod examined;
mod instant;
mod joint;
mod jumps;
mod lag;
mod late;
pub mod leave_out;
mod local_cubic;
mod log;
mod low_pass;
mod measured;
mod named_columns;
mod projection;
mod read;
mod repeated;
mod signal;
mod smooth;
mod standstill;
pub mod statistics;
mod table;
mod together;
pub(crate) mod torque_column;
mod trajectory;

pub use audit::{
    Audit, Channel, Finding, JointAudit, MAX_LAG_S, Remedy, Repeated, Response, Severity,
    TorqueDemand, TorqueLag, VelocityCheck, audit, audit_together, report_repeats,
};
pub(crate) use audit::{moves_as_one, reversed_driving};
pub use channels::Channels;
pub use column::{Column, Quantity};
pub use columns::{Columns, MeasuredColumn};
pub(crate) use dropped::is_gap;
pub use error::{CellFault, LogError, Place};
pub(crate) use instant::SAME_S;
pub use instant::{row_after, row_from};
pub(crate) use joint::of_joints;
pub use joint::{Joint, JointError};
pub use leave_out::{LeaveOut, LeaveOutError};
pub(crate) use local_cubic::rows_around;
pub use local_cubic::{LocalCubic, half_width_s, local_cubic};
pub use log::{Interval, Log};
pub(crate) use measured::NOMINAL;
pub use measured::{MEASURED_PREFIX, Measured, is_measured};
pub use smooth::{Smooth, Smoothing};
pub use table::{Arrays, Numbers, Numeric, Table};
pub use together::{Together, together};
pub use torque_column::TorqueColumn;
pub use trajectory::{Thinning, Trajectory, trajectories};
