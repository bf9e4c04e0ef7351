//! What a reader of the written files predicts beside what the program itself does.

mod client;
mod inputs;
mod predictions;
mod reference;

pub use client::PythonClient;
pub use inputs::Samples;
pub use predictions::{Answers, Difference};
pub(super) use reference::Prediction;
