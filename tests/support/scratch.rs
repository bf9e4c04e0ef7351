//! A folder for the files of one test, in which the program runs.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

#[cfg(unix)]
use super::binary::within;
use super::binary::{printed, refusal, said, succeeds};
use super::paths::config;
use super::text;

const PENDULUM: &str = include_str!("../../models/pendulum.toml");

/// A scratch folder. The lines that it runs are command lines without the program's name, words between spaces;
/// `$REPO` is the repository's folder.
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn folder(&self) -> &Path {
        self.0.path()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn has(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    /// How many files and folders there are.
    pub fn count(&self) -> usize {
        fs::read_dir(self.folder()).unwrap().count()
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn read_json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_residyn"));
        command.current_dir(self.folder()).args(words(line));
        command
    }

    pub fn run(&self, line: &str) -> Output {
        self.command(line).output().expect("the binary runs")
    }

    /// The standard output of a run that must succeed.
    #[track_caller]
    pub fn succeeds(&self, line: &str) -> String {
        printed(&self.run(line), &[0], &[line])
    }

    /// The standard output of a run that must end with an answer, yes or no.
    #[track_caller]
    pub fn answers(&self, line: &str) -> String {
        printed(&self.run(line), &[0, 1], &[line])
    }

    /// The JSON of a run that must succeed.
    #[track_caller]
    pub fn json(&self, line: &str) -> Value {
        serde_json::from_str(&self.succeeds(&format!("{line} --json"))).unwrap()
    }

    /// The message of a run that must be refused.
    #[track_caller]
    pub fn refuses(&self, line: &str) -> String {
        refusal(&self.run(line), &[line])
    }

    /// The short message of a run in little memory that must be refused.
    #[cfg(unix)]
    #[track_caller]
    pub fn refuses_in_little_memory(&self, line: &str) -> String {
        let mut command = within(200_000);
        command.current_dir(self.folder()).args(words(line));
        let message = refusal(&command.output().unwrap(), &[line]);
        assert!(message.len() < 3000, "{} bytes", message.len());
        message
    }

    /// The errors of a run that must end without reaching an answer.
    #[track_caller]
    pub fn ends_without(&self, line: &str) -> String {
        said(&self.run(line), &[1], &[line])
    }

    /// The logs that a plant writes with these seeds, such as `run1.csv`; more words of the command may follow the plant.
    #[track_caller]
    pub fn simulates(&self, plant: &str, seeds: &[u32]) {
        for seed in seeds {
            self.succeeds(&format!(
                "simulate --plant {plant} --seed {seed} --out run{seed}.csv"
            ));
        }
    }

    /// The model file, `model.toml`, of a URDF.
    #[track_caller]
    pub fn new_model(&self, urdf: &Path) -> String {
        let model = text(&self.path("model.toml")).to_owned();
        succeeds(&["new", "--from-urdf", text(urdf), "--out", &model]);
        model
    }

    /// The error 0.5 s ahead of the first joint, as `residyn evaluate` gives it with these words.
    #[track_caller]
    pub fn evaluated(&self, line: &str) -> f64 {
        let found = self.json(&format!("evaluate {line}"));
        found["position_rmse"][1][0].as_f64().unwrap()
    }

    /// A file with these contents.
    pub fn file(&self, name: &str, contents: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        fs::write(&path, contents).unwrap();
        text(&path).to_owned()
    }

    /// A log of 2 s of a pendulum, a row every 10 ms; `row` gives q, qd and tau at a time.
    pub fn log(&self, name: &str, row: impl Fn(f64) -> [f64; 3]) -> String {
        self.log_at(name, (0..200).map(|row| f64::from(row) * 0.01), row)
    }

    /// A log of a pendulum whose rows are at these times.
    pub fn log_at(
        &self,
        name: &str,
        times: impl Iterator<Item = f64>,
        row: impl Fn(f64) -> [f64; 3],
    ) -> String {
        let mut log = "time,q1,qd1,tau1\n".to_owned();
        for time in times {
            let [q, qd, tau] = row(time);
            writeln!(log, "{time:?},{q:?},{qd:?},{tau:?}").unwrap();
        }
        self.file(name, log)
    }

    /// The model of the pendulum with one text replaced by another.
    #[track_caller]
    pub fn model(&self, name: &str, from: &str, to: &str) -> String {
        self.file(name, replaced(PENDULUM, from, to))
    }

    /// The pendulum with this acceleration.
    pub fn moving_by(&self, name: &str, acceleration: &str) -> String {
        self.model(name, "C_g * sin(q1) + C_i * tau1", acceleration)
    }

    /// A file of `configs` with one text replaced by another, under its own name.
    #[track_caller]
    pub fn changed(&self, file: &str, from: &str, to: &str) -> String {
        let text = fs::read_to_string(config(file)).unwrap();
        let (_, name) = file.rsplit_once('/').unwrap();
        self.file(name, replaced(&text, from, to))
    }
}

/// Copies the files of a folder.
pub fn copy_files(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// A text with the first of one text, which must be there, replaced by another.
#[track_caller]
pub fn replaced(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from:?} is missing in:\n{text}");
    text.replacen(from, to, 1)
}

/// The words of a command line; `$REPO` is the repository's folder.
pub fn words(line: &str) -> impl Iterator<Item = String> {
    line.split_whitespace()
        .map(|word| word.replace("$REPO", env!("CARGO_MANIFEST_DIR")))
}

pub fn swinging(time: f64) -> [f64; 3] {
    let torque = 0.3 * (3.0 * time).sin();
    [(2.0 * time).sin(), 2.0 * (2.0 * time).cos(), torque]
}
