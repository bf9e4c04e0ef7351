//! Formats of other programs, one file or folder each. Models are written in all of them; robot descriptions are read as
//! well. A written file is checked against the program's own predictions ([`Format::predict`]).
//!
//! A new format is a file with a [`Format`] and one line in [`FORMATS`]: commands, lists and tests read that table.

mod blocks;
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
mod rest;
mod robot;
mod template;
mod urdf;
mod verify;
mod xml;

pub use export_model::{ExportModel, ExportedEffect, ExportedState, ExportedTask};
pub use format::{ExportError, File, Format, RobotReader, model_of, robot_reader};
pub use json::{Description, ImportError, Imported};
pub use robot::write_back::{WrittenBack, write_back};
pub use verify::{Client, ClientError, Difference, Predictions, PythonClient, Samples, rollout_s};

use thiserror::Error;

use residyn_core::expr::suggestion;

/// Every format.
pub const FORMATS: &[&Format] = &[
    &c::FORMAT,
    &fmu::fmi3::FORMAT,
    &fmu::fmi2::FORMAT,
    &blocks::isaaclab::FORMAT,
    &json::JSON,
    &latex::FORMAT,
    &mjcf::FORMAT,
    &blocks::mjlab::FORMAT,
    &onnx::FORMAT,
    &python::FORMAT,
    &json::SAFETENSORS,
    &urdf::FORMAT,
];

/// No format has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown format `{name}`{near}; there are {}", names().join(", "))]
pub struct UnknownFormat {
    name: String,
    /// A similar known name, as the end of a sentence; empty without one.
    near: String,
}

fn names() -> Vec<&'static str> {
    FORMATS.iter().map(|format| format.name).collect()
}

/// The format of this name.
///
/// # Errors
/// Unknown name, with the nearest known one.
pub fn find(name: &str) -> Result<&'static Format, UnknownFormat> {
    let format = FORMATS.iter().find(|format| format.name == name);
    format.copied().ok_or_else(|| UnknownFormat {
        name: name.to_owned(),
        near: suggestion(name, names()),
    })
}
