//! How this process was called: the only place that reads the clock for a report.

use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

use anyhow::{Context, Result};

use super::command_line;
use residyn_core::model::{Call, InputFile};
use residyn_io::files::sha256_of;

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

/// Files read in one role. Names of built-in files are not among them.
pub(super) fn files(role: &str, paths: &[PathBuf]) -> Result<Vec<InputFile>> {
    let read = |path: &Path| {
        let name = path.display();
        let sha256 = sha256_of(path).with_context(|| format!("{name}: cannot be read"))?;
        Ok(InputFile {
            role: role.to_owned(),
            path: name.to_string(),
            sha256,
        })
    };
    let there = paths.iter().filter(|path| path.is_file());
    there.map(|path| read(path)).collect()
}
