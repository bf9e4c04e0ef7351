//! The model in other people's tools: one file a format, each of which reads a [`Portable`] and says before writing
//! what it cannot carry; and what a reader of the written files predicts beside what the program itself does.

mod answers;
mod c;
mod description;
mod fmu;
mod format;
mod held;
mod latex;
mod mechanism;
mod mjcf;
mod onnx;
mod portable;
mod prediction;
mod python;
mod python_client;
mod rebuilt;
mod samples;
mod urdf;

pub use answers::{Answers, Difference};
pub use description::{Description, ImportError, Imported};
pub use format::{ExportError, File, Format, Reader, Unread, find};
pub use held::{HeldFilter, Sum as HeldSum};
pub use portable::{CarriedEffect, Portable};
pub use python_client::PythonClient;
pub use samples::Samples;

/// Every format, by name.
pub const FORMATS: &[&Format] = &[
    &c::FORMAT,
    &fmu::fmi3::FORMAT,
    &fmu::fmi2::FORMAT,
    &description::JSON,
    &latex::FORMAT,
    &mjcf::FORMAT,
    &onnx::FORMAT,
    &python::FORMAT,
    &description::SAFETENSORS,
    &urdf::FORMAT,
];
