//! Large logs, many logs and many effects in one call.
//!
//! `RESIDYN_LOAD_MB` is the size of the large log, 100 by default; `TMPDIR` names a folder for temporary files of that
//! size. `benches/load` measures speeds.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

use serde_json::Value;

use crate::support::{Scratch, residyn_within, text};

/// A row of a pendulum with gravity and friction, driven by two sines, in the digits of a logger that prints doubles.
fn row(time: f64) -> [f64; 3] {
    let angle = 0.9 * (1.1 * time).sin() + 0.2 * (3.7 * time).sin();
    let speed = 0.99 * (1.1 * time).cos() + 0.74 * (3.7 * time).cos();
    let acceleration = -1.089 * (1.1 * time).sin() - 2.738 * (3.7 * time).sin();
    // The built-in pendulum with its declared values, and dry friction of 0.16 N m.
    let torque = (acceleration - 15.0 * angle.sin()) / 3.0 + 0.16 * (speed / 0.01).tanh();
    [angle, speed, torque]
}

/// Writes a log of `rows` rows that begins at `start_s` of the motion.
fn write_log(path: &Path, rows: usize, step_s: f64, start_s: f64) {
    let mut out = BufWriter::new(File::create(path).unwrap());
    writeln!(out, "time,q1,qd1,tau1").unwrap();
    for k in 0..rows {
        let time = step_s * k as f64;
        let [angle, speed, torque] = row(start_s + time);
        writeln!(out, "{time:.3},{angle:.16},{speed:.16},{torque:.16}").unwrap();
    }
    out.flush().unwrap();
}

fn megabytes() -> u64 {
    let message = std::env::var("RESIDYN_LOAD_MB").ok();
    message.map_or(100, |message| {
        message.parse().expect("RESIDYN_LOAD_MB is a number")
    })
}

#[test]
#[cfg(unix)]
fn a_large_log_is_read_and_audited_in_twice_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.csv");
    write_log(&path, 15_000 * megabytes() as usize, 0.001, 0.0);
    let kilobytes = fs::metadata(&path).unwrap().len() / 1000;
    let output = residyn_within(2 * kilobytes, &["audit", "--json", text(&path)]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{errors}");
    let audit: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(audit[0]["rows"], 15_000 * megabytes());
    assert_eq!(audit[0]["examined_rows"], 262_144);
}

/// Writes `count` logs of a second, each of another part of the motion, and returns their paths.
fn write_logs(folder: &Path, count: usize) -> Vec<String> {
    let log = |k: usize| {
        let path = folder.join(format!("run{k}.csv"));
        write_log(&path, 120, 0.01, 7.3 * k as f64);
        text(&path).to_owned()
    };
    (0..count).map(log).collect()
}

#[test]
#[cfg(unix)]
fn a_thousand_logs_are_audited_and_predicted_in_one_call() {
    let scratch = Scratch::new();
    let logs = write_logs(scratch.folder(), 1000);
    let within = |arguments: &[&str]| -> Value {
        let logs = logs.iter().map(String::as_str);
        let all: Vec<&str> = arguments.iter().copied().chain(logs).collect();
        let output = residyn_within(400_000, &all);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(output.status.code(), Some(0 | 1)), "{errors}");
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let audits = within(&["audit", "--json"]);
    assert_eq!(audits.as_array().unwrap().len(), 1000);
    let evaluated = within(&["evaluate", "--json", "--model", "pendulum", "--test"]);
    assert!(evaluated["windows"][0].as_u64().unwrap() > 10_000);
}

/// Writes `count` effects of a joint: no two of the same shape.
fn write_effects(folder: &Path, count: usize) {
    for k in 0..count {
        let wave = 0.2 + 0.05 * k as f64;
        let file = format!(
            "[effect]\nname = \"wave{k}\"\nabout = \"a torque of wave number {wave:.2}\"\nforce = \"-a * sin({wave:.2} * q)\"\n\n\
             [parameters]\na = {{ unit = \"N m\", typical = 0.1, about = \"size\" }}\n"
        );
        fs::write(folder.join(format!("wave{k}.toml")), file).unwrap();
    }
}

#[test]
fn a_library_of_five_hundred_effects_is_searched_within_its_time() {
    let scratch = Scratch::new();
    write_logs(scratch.folder(), 12);
    fs::create_dir(scratch.path("effects")).unwrap();
    write_effects(&scratch.path("effects"), 500);
    let listed = scratch.succeeds("list effects --effects effects");
    assert_eq!(listed.matches("wave number").count(), 500);
    let logs: String = (0..12).map(|k| format!(" run{k}.csv")).collect();
    let given = format!("--model pendulum --budget 5s --effects effects --train{logs}");
    let json = scratch.answers(&format!("closeloop --json --out report {given}"));
    let report: Value = serde_json::from_str(&json).unwrap();
    assert!(report["effects"].is_array());
}
