//! A folder for the files of one test.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use super::paths::config;
use super::text;

const PENDULUM: &str = include_str!("../../models/pendulum.toml");

/// A scratch folder.
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
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
    pub fn model(&self, name: &str, from: &str, to: &str) -> String {
        assert!(PENDULUM.contains(from), "{from}");
        self.file(name, PENDULUM.replacen(from, to, 1))
    }

    /// The pendulum with this acceleration.
    pub fn moving_by(&self, name: &str, acceleration: &str) -> String {
        self.model(name, "C_g * sin(q1) + C_i * tau1", acceleration)
    }

    /// A file of `configs` with one text replaced by another, under its own name.
    pub fn changed(&self, file: &str, from: &str, to: &str) -> String {
        let text = fs::read_to_string(config(file)).unwrap();
        assert!(text.contains(from), "{from}");
        let (_, name) = file.rsplit_once('/').unwrap();
        self.file(name, text.replacen(from, to, 1))
    }

    pub fn out(&self) -> String {
        text(&self.path("out")).to_owned()
    }
}

pub fn swinging(time: f64) -> [f64; 3] {
    let torque = 0.3 * (3.0 * time).sin();
    [(2.0 * time).sin(), 2.0 * (2.0 * time).cos(), torque]
}
