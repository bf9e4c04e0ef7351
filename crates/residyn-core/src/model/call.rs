//! How the program was called, when, and what it read.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// how the program was called, when, and what it read
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Call {
    /// the command line as typed
    pub command: String,
    /// UTC, as 2026-11-23T21:45:00Z
    pub began: String,
    /// time until its results were written, s
    pub took_s: f64,
    /// the files that it read; built-in and simulated inputs are not listed
    pub inputs: Vec<InputFile>,
}

/// a file that the program read
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InputFile {
    /// what it was read as: model, train, test
    pub role: String,
    /// as given
    pub path: String,
    /// SHA-256 of its bytes, 64 hexadecimal digits
    pub sha256: String,
}
