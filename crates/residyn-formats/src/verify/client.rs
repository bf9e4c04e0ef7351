use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Output};

use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use super::{Predictions, Samples};

/// A client reads a written model and predicts from it.
#[derive(Debug)]
pub enum Client {
    /// A Python program with packages that users of the format have.
    Python(PythonClient),
    /// This program, from the file alone.
    Own(fn(&Path, &Samples) -> Result<Predictions, ClientError>),
    /// None, for this reason.
    None(&'static str),
}

/// Why a client made no prediction.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ClientError {
    /// There is no client on this machine: what to install, or why there is none.
    #[error("{0}")]
    Unavailable(String),
    /// There is nothing to compare with: the place where the model's own prediction is not finite.
    #[error("{0}")]
    NotFinite(String),
    /// The client's own message about the file.
    #[error("{0}")]
    Failed(String),
}

/// A short Python program that loads a written model and prints what it predicts: an example for users and a test at
/// once.
#[derive(Debug)]
pub struct PythonClient {
    pub name: &'static str,
    pub script: &'static str,
    /// Its dependencies, as arguments of `pip install`.
    pub packages: &'static str,
}

impl Client {
    /// The predictions of the model in `path`.
    ///
    /// # Errors
    /// No client available, or one that fails on the file.
    pub fn predict(&self, path: &Path, samples: &Samples) -> Result<Predictions, ClientError> {
        match self {
            Self::Python(client) => client.ask(path, samples),
            Self::Own(predict) => predict(path, samples),
            Self::None(reason) => Err(ClientError::Unavailable((*reason).to_owned())),
        }
    }
}

impl PythonClient {
    /// Run it as `python SCRIPT FILE QUESTION.json`; it prints its answer as JSON, for example [`Predictions`] at
    /// [`Samples`]. The interpreter is `$RESIDYN_PYTHON`, else `python3`.
    ///
    /// # Errors
    /// No interpreter, a missing package, or a file that the script cannot read.
    pub fn ask<A: DeserializeOwned>(
        &self,
        path: &Path,
        question: &impl Serialize,
    ) -> Result<A, ClientError> {
        let python =
            std::env::var_os("RESIDYN_PYTHON").unwrap_or_else(|| OsString::from("python3"));
        let output = self.run(&python, path, question)?;
        let errors = String::from_utf8_lossy(&output.stderr);
        if errors.contains("ModuleNotFoundError") {
            let last = errors.lines().last().unwrap_or_default();
            let (python, packages) = (python.display(), self.packages);
            return Err(ClientError::Unavailable(format!(
                "{last}; `{python} -m pip install {packages}`"
            )));
        }
        if !output.status.success() {
            return Err(ClientError::Failed(format!("{}: {errors}", self.name)));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|error| ClientError::Failed(format!("{}: its output: {error}", self.name)))
    }

    fn run(
        &self,
        python: &OsString,
        path: &Path,
        question: &impl Serialize,
    ) -> Result<Output, ClientError> {
        let io = |error: std::io::Error| {
            ClientError::Unavailable(format!("no temporary folder for the question: {error}"))
        };
        let folder = tempfile::tempdir().map_err(io)?;
        let script = folder.path().join(self.name);
        let input = folder.path().join("question.json");
        let json = serde_json::to_vec(question).expect("questions are finite numbers");
        std::fs::write(&script, self.script).map_err(io)?;
        std::fs::write(&input, json).map_err(io)?;
        let arguments = [script.as_path(), path, input.as_path()];
        Command::new(python)
            .args(arguments)
            .output()
            .map_err(|error| {
                let python = python.display();
                ClientError::Unavailable(format!(
                    "{python} does not start ({error}); name a Python in RESIDYN_PYTHON"
                ))
            })
    }
}
