//! One trajectory in every format of log and recording, written by the libraries that people use.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use tempfile::TempDir;

use super::clients::client;

/// A trajectory of two joints as CSV.
pub fn trajectory() -> String {
    let row = |k: u32| {
        let t = f64::from(k) / 250.0;
        let (q, qd) = (
            [t.sin(), 0.5 * (2.0 * t).cos()],
            [t.cos(), -(2.0 * t).sin()],
        );
        format!(
            "{t},{},{},{},{},{},{}\n",
            q[0],
            q[1],
            qd[0],
            qd[1],
            0.1 * t,
            -0.2 * t
        )
    };
    let rows: String = (0..50).map(row).collect();
    format!("time,q1,q2,qd1,qd2,tau1,tau2\n{rows}")
}

/// A folder with `run.csv` and the same in every format, made once; `None` if the clients that write them are missing.
pub fn formats() -> Option<&'static Path> {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run.csv");
        fs::write(&run, trajectory()).unwrap();
        client("logs.py", &[&run, folder.path()]);
        folder
    });
    let is_written = folder.path().join("pickled.npz").exists();
    is_written.then(|| folder.path())
}

/// A folder with `run.csv` and recordings of it, made once; `None` if the clients that write them are missing.
pub fn recordings() -> Option<&'static Path> {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run.csv");
        fs::write(&run, trajectory()).unwrap();
        client("recordings.py", &[&run, folder.path()]);
        folder
    });
    let is_written = folder.path().join("no_cdr.mcap").exists();
    is_written.then(|| folder.path())
}
