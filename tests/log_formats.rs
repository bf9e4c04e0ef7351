//! One trajectory in every format of logs, written by the libraries that people use.

use std::fs;
use std::path::Path;

use residyn::data::{Columns, Log};

use crate::clients::client;

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

fn read(path: &Path) -> Result<Log, String> {
    Log::read(path, 2, &Columns::default()).map_err(|error| error.to_string())
}

#[test]
fn every_format_holds_the_same_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("run.csv"), trajectory()).unwrap();
    client("logs.py", &[&at("run.csv"), folder.path()]);
    if !at("pickled.npz").exists() {
        return;
    }
    let wanted = read(&at("run.csv")).unwrap();
    for name in [
        "packed.csv.gz",
        "german.csv",
        "tabs.tsv",
        "matrices.npz",
        "columns.npz",
        "fortran.npz",
    ] {
        let found = read(&at(name)).unwrap();
        let channels = |log: &Log| {
            (
                log.time.clone(),
                log.q.clone(),
                log.qd.clone(),
                log.tau.clone(),
            )
        };
        assert!(channels(&found) == channels(&wanted), "{name}");
    }
    let counts = read(&at("integers.npz")).unwrap();
    assert_eq!((counts.time[7], counts.q[0][1]), (7.0, 4.0));
    for (name, wanted) in [
        ("short.npz", "short.npz, row 48, column \"tau1\": is empty"),
        ("gap.npz", "row 5, column \"q2\": \"NaN\" is not a finite"),
        (
            "pickled.npz",
            "array \"q\" holds pickled objects, which are never read",
        ),
    ] {
        let said = read(&at(name)).unwrap_err();
        assert!(said.contains(wanted), "{said}");
    }
}

#[test]
fn files_that_are_not_read_get_the_line_that_converts_them() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&[u8], &str); 5] = [
        (b"#ROSBAG V2.0\n", "rosbags-convert"),
        (b"\x89HDF\r\n\x1a\n", "h5py"),
        (b"MATLAB 5.0 MAT-file", "scipy.io"),
        (b"PAR1\x15\x04", "read_parquet"),
        (b"PK\x03\x04 and no more", "numpy.savez"),
    ];
    for (begin, remedy) in cases {
        let path = folder.path().join("run.log");
        fs::write(&path, begin).unwrap();
        let said = read(&path).unwrap_err();
        assert!(said.contains("run.log") && said.contains(remedy), "{said}");
    }
}
