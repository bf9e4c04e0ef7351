//! How this process was called: the only place that reads the clock for a report.

use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

use anyhow::{Context, Result};

use super::command_line;
use crate::runs::{Call, InputFile};

/// When a command began.
pub(super) struct Begun {
    at: SystemTime,
    clock: Instant,
}

impl Begun {
    pub fn now() -> Self {
        Self {
            at: SystemTime::now(),
            clock: Instant::now(),
        }
    }

    /// The call of the command, which read these files.
    pub fn call(&self, inputs: &[InputFile]) -> Call {
        Call {
            command: command_line(),
            began: humantime::format_rfc3339_seconds(self.at).to_string(),
            took_s: self.clock.elapsed().as_secs_f64(),
            inputs: inputs.to_vec(),
        }
    }
}

/// Files read in one role. Names of what is built in are not among them.
pub(super) fn files(role: &str, paths: &[PathBuf]) -> Result<Vec<InputFile>> {
    let read = |path: &Path| {
        InputFile::read(role, path).with_context(|| format!("{}: cannot be read", path.display()))
    };
    let there = paths.iter().filter(|path| path.is_file());
    there.map(|path| read(path)).collect()
}
