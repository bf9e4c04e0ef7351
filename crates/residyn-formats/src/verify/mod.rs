//! Checks a written file: a client predicts from it at sample points, and the difference from the program's own
//! predictions is measured.

mod client;
mod draw;
mod predictions;
mod reference;
mod samples;

pub use client::{Client, ClientError, PythonClient};
pub(super) use draw::draw;
pub use draw::rollout_s;
pub use predictions::{Difference, Predictions};
pub(super) use reference::ReferenceModel;
pub use samples::Samples;
