use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use super::{Answers, Samples};
use crate::formats::Unread;

/// A short Python program that loads a written model and prints what it predicts: an example for users, a test, and
/// what measures an export.
#[derive(Debug)]
pub struct PythonClient {
    pub name: &'static str,
    pub script: &'static str,
    /// What `pip` installs for it.
    pub packages: &'static str,
}

impl PythonClient {
    /// Run it as `python SCRIPT FILE SAMPLES.json`; it prints [`Answers`] as JSON. The interpreter is
    /// `$RESIDYN_PYTHON`, else `python3`.
    ///
    /// # Errors
    /// No interpreter, a package that is missing, or a file that it cannot read.
    pub fn ask(&self, path: &Path, samples: &Samples) -> Result<Answers, Unread> {
        let io = |error: std::io::Error| Unread::NoReader(format!("no place for samples: {error}"));
        let folder = tempfile::tempdir().map_err(io)?;
        let (script, question) = (
            folder.path().join(self.name),
            folder.path().join("samples.json"),
        );
        let json = serde_json::to_vec(samples).expect("samples are finite numbers");
        std::fs::write(&script, self.script).map_err(io)?;
        std::fs::write(&question, json).map_err(io)?;
        let python =
            std::env::var_os("RESIDYN_PYTHON").unwrap_or_else(|| OsString::from("python3"));
        let run = Command::new(&python)
            .args([script.as_path(), path, question.as_path()])
            .output()
            .map_err(|error| {
                let python = python.display();
                Unread::NoReader(format!(
                    "{python} does not start ({error}); name a Python in RESIDYN_PYTHON"
                ))
            })?;
        let said = String::from_utf8_lossy(&run.stderr);
        if said.contains("ModuleNotFoundError") {
            let last = said.lines().last().unwrap_or_default();
            let (python, packages) = (python.display(), self.packages);
            return Err(Unread::NoReader(format!(
                "{last}; `{python} -m pip install {packages}`"
            )));
        }
        if !run.status.success() {
            return Err(Unread::Refused(format!("{}: {said}", self.name)));
        }
        serde_json::from_slice(&run.stdout)
            .map_err(|error| Unread::Refused(format!("{}: its answer: {error}", self.name)))
    }
}
