//! Runs disturbed by signals and failing calls.

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::support::paths::ours;

/// A disturbance of a run.
#[derive(Debug, Clone, Copy)]
pub enum Fault {
    /// A fault of this kind (see tests/clients/faults.c) at the `at`-th file change.
    Call { kind: &'static str, at: usize },
    /// A signal at this time.
    Signal { name: &'static str, after: Duration },
}

impl Fault {
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Call { kind, .. } => kind,
            Self::Signal { name, .. } => name,
        }
    }
}

/// How a run ended.
pub struct Ended {
    pub status: ExitStatus,
    pub said: String,
}

impl Ended {
    pub fn by(&self, signal: i32) -> bool {
        self.status.signal() == Some(signal)
    }
}

/// The library below the program.
pub struct Layer(PathBuf);

impl Layer {
    /// Compiled into a folder.
    pub fn in_folder(folder: &Path) -> Self {
        let library = folder.join("faults.so");
        let mut compiler = Command::new("cc");
        compiler.args(["-O1", "-shared", "-fPIC", "-o"]);
        let compiled = compiler
            .arg(&library)
            .arg(ours("tests/clients/faults.c"))
            .arg("-ldl")
            .status();
        assert!(compiled.unwrap().success());
        Self(library)
    }

    fn command(&self, root: &Path, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_residyn"));
        command
            .args(arguments)
            .current_dir(root)
            .env("LD_PRELOAD", &self.0)
            .env("FAULT_ROOT", root)
            // One thread makes its calls in the same order each time.
            .env("RAYON_NUM_THREADS", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command
    }

    /// Run a command in a folder.
    pub fn run(&self, root: &Path, arguments: &[&str], fault: Option<Fault>) -> Ended {
        let mut command = self.command(root, arguments);
        if let Some(Fault::Call { kind, at }) = fault {
            command.env("FAULT", kind).env("FAULT_AT", at.to_string());
        }
        let child = command.spawn().unwrap();
        if let Some(Fault::Signal { name, after }) = fault {
            sleep(after);
            // It may have ended.
            let mut kill = Command::new("kill");
            kill.args(["-s", name, &child.id().to_string()]);
            _ = kill.stderr(Stdio::null()).status().unwrap();
        }
        let output = child.wait_with_output().unwrap();
        Ended {
            status: output.status,
            said: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Run a command undisturbed. Returns the letters of all file changes, and all files as they were when they got
    /// their names.
    pub fn traced(
        &self,
        root: &Path,
        arguments: &[&str],
        folder: &Path,
    ) -> (String, Vec<(String, Vec<u8>)>) {
        let (trace, keep) = (folder.join("trace"), folder.join("keep"));
        fs::create_dir(&keep).unwrap();
        let mut command = self.command(root, arguments);
        command.env("FAULT_TRACE", &trace).env("FAULT_KEEP", &keep);
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
        let kept = fs::read_dir(keep).unwrap().map(|entry| {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            let (_, name) = name.split_once('-').unwrap();
            (name.to_owned(), fs::read(entry.path()).unwrap())
        });
        (fs::read_to_string(trace).unwrap(), kept.collect())
    }
}
