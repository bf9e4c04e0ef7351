//! The model in other people's tools: one file a format, each of which reads a [`Portable`] and says before writing
//! what it cannot carry; and what a reader of the written files predicts beside what the program itself does.

mod c;
mod discrete_filter;
mod export_model;
mod fmu;
mod format;
mod json;
mod latex;
mod mjcf;
mod onnx;
mod python;
mod robot;
mod urdf;
mod verify;

pub use discrete_filter::{HeldFilter, Sum as HeldSum};
pub use export_model::{CarriedEffect, Portable};
pub use format::{ExportError, File, Format, Reader, Unread, find};
pub use json::{Description, ImportError, Imported};
pub use mjcf::read_mjcf;
pub use urdf::read_urdf;
pub use verify::{Answers, Difference, PythonClient, Samples};

/// Every format, by name.
pub const FORMATS: &[&Format] = &[
    &c::FORMAT,
    &fmu::fmi3::FORMAT,
    &fmu::fmi2::FORMAT,
    &json::JSON,
    &latex::FORMAT,
    &mjcf::FORMAT,
    &onnx::FORMAT,
    &python::FORMAT,
    &json::SAFETENSORS,
    &urdf::FORMAT,
];
