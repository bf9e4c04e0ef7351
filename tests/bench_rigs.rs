//! The comparison on measured rigs: its file, and a small rig of simulated logs end to end.

use std::fs;
use std::path::{Path, PathBuf};

use residyn::bench::rigs::{RigsError, read};
use residyn::bench::{Cell, read as grid};
use residyn::model::Library;
use serde_json::Value;

use crate::support::{refuses, residyn, succeeds, text};

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs/bench")
        .join(name)
}

/// Two logs of a pendulum with dry friction, and a third one.
fn record(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let cell: &Cell = &grid(&config("smoke.toml")).unwrap()[0];
    let model = Library::built_in().model(&cell.model).unwrap();
    for log in cell.record(&model).unwrap().0 {
        log.write(folder.join(&log.path)).unwrap();
    }
}

/// The rig's true values, without its friction, as the published set.
const RIGS: &str = r#"
plain = ["coulomb_friction"]

[[rig]]
name = "rig"
folder = "logs"
model = "pendulum"
parameters = { C_i = 5.0 }
logs = ["log1.csv", "log2.csv"]
test = "each_log"
leave_out = ["log2.csv@7.5-8"]
published = [{ name = "1.0", model = "pendulum", parameters = { C_g = -19.62, C_i = 6.6667 } }]
also = { third = ["log3.csv"] }
"#;

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(rigs: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        record(&folder.path().join("logs"));
        fs::write(folder.path().join("rigs.toml"), rigs).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn arguments(&self) -> Vec<String> {
        let named = |name: &str| text(&self.path(name)).to_owned();
        let mut all: Vec<String> = ["bench", "rigs", "--json"].map(str::to_owned).into();
        for (flag, name) in [("--rigs", "rigs.toml"), ("--data", ""), ("--out", "out")] {
            all.extend([flag.to_owned(), named(name)]);
        }
        all
    }

    fn run(&self) -> Value {
        let arguments = self.arguments();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        serde_json::from_str(&succeeds(&arguments)).unwrap()
    }

    fn refused(&self) -> String {
        let arguments = self.arguments();
        refuses(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }
}

/// Error of a model in a row, 0.5 s ahead \[rad\].
fn error(row: &Value, model: &str) -> f64 {
    let models = row["models"].as_array().unwrap();
    let entry = models.iter().find(|entry| entry["model"] == model).unwrap();
    entry["pooled"][1]["position_rms"].as_f64().unwrap()
}

#[test]
fn each_log_is_left_out_in_turn_and_a_second_run_repeats_nothing() {
    let bench = Bench::new(RIGS);
    let summary = bench.run();
    let rows = summary["rows"].as_array().unwrap();
    assert_eq!(
        (rows.len(), &rows[0]["folds"], &rows[1]["folds"]),
        (2, &2.into(), &1.into())
    );
    assert_eq!(rows[1]["group"], "third");
    for row in rows {
        assert_eq!(row["named"]["coulomb_friction@1"], row["folds"], "{row}");
        let (after, plain) = (error(row, "after"), error(row, "plain structure"));
        assert!((after / plain - 1.0).abs() < 0.05, "{after} {plain}");
        for frictionless in ["declared, fitted", "published 1.0"] {
            assert!(after < 0.2 * error(row, frictionless), "{row}");
        }
        assert!(
            error(row, "declared") > error(row, "published 1.0"),
            "{row}"
        );
        assert_eq!(row["best"][0], "plain structure");
    }
    let logs = &rows[0]["models"][0]["logs"];
    assert_eq!(
        (&logs[0][0], &logs[1][0]),
        (&"log1.csv".into(), &"log2.csv".into())
    );
    let windows = |log: usize| logs[log][1][1]["windows"].as_u64().unwrap();
    assert!(windows(1) < windows(0), "left-out windows are not scored");
    let table = fs::read_to_string(bench.path("out/rigs.md")).unwrap();
    assert!(table.contains("\n| rig, third | 1 |"), "{table}");

    // A fold that failed counts as failed, in the table and in the exit status; the others are not run again.
    let path = bench.path("out/rig/log1.csv/closeloop.json");
    let mut line: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    line["found"] = serde_json::json!({"Err": "the fit diverged"});
    fs::write(&path, line.to_string()).unwrap();
    let output = residyn(
        &bench
            .arguments()
            .iter()
            .map(String::as_str)
            .collect::<Vec<_>>(),
    );
    assert_eq!(output.status.code(), Some(1));
    let again: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(again["failures"][0][2], "the fit diverged");
    assert_eq!(again["rows"][0]["ratio"], Value::Null);
    assert_eq!(again["rows"][1], rows[1]);
    let table = fs::read_to_string(bench.path("out/rigs.md")).unwrap();
    assert!(table.contains("| 1 failed |"), "{table}");
    // Another result is not used for other logs.
    let log = fs::read_to_string(bench.path("logs/log3.csv")).unwrap();
    fs::write(
        bench.path("logs/log3.csv"),
        log.trim_end().rsplit_once('\n').unwrap().0,
    )
    .unwrap();
    assert_eq!(bench.run()["failures"].as_array().unwrap().len(), 0);
}

#[test]
fn the_halves_of_a_single_log_train_and_test() {
    let rigs = RIGS.replace("[\"log1.csv\", \"log2.csv\"]", "[\"log2.csv\"]");
    let bench = Bench::new(&rigs.replace("each_log", "halves").replace("also", "#"));
    let summary = bench.run();
    let row = &summary["rows"][0];
    assert_eq!(
        (summary["rows"].as_array().unwrap().len(), &row["folds"]),
        (1, &2.into())
    );
    assert!(
        error(row, "after") < 0.5 * error(row, "declared, fitted"),
        "{row}"
    );
}

#[test]
fn the_rigs_of_the_repository_are_read() {
    let rigs = read(&config("rigs.toml")).unwrap();
    let names: Vec<&str> = rigs.iter().map(|rig| rig.name.as_str()).collect();
    assert_eq!(names.len(), 5, "{names:?}");
    let library = Library::built_in();
    for rig in &rigs {
        let sets = rig.published.iter().map(|set| &set.model);
        for declared in sets.chain([&rig.declared]) {
            let model = library.model(&declared.model).unwrap();
            for name in declared.parameters.keys() {
                assert!(
                    model.parameters.iter().any(|p| p.name == *name),
                    "{}: {name}",
                    rig.name
                );
            }
        }
    }
}

#[test]
fn a_wrong_file_of_rigs_is_refused_with_the_line_and_a_remedy() {
    let place = |from: &str, to: &str| {
        assert!(RIGS.contains(from));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rigs.toml");
        fs::write(&path, RIGS.replace(from, to)).unwrap();
        match read(&path).unwrap_err() {
            RigsError::File { line, message, .. } => (line, message),
            other => panic!("{other}"),
        }
    };
    let (line, message) = place("folder =", "folders =");
    assert_eq!(line, 6, "{message}");
    assert!(
        message.contains("unknown field `folders`, expected one of"),
        "{message}"
    );
    let (line, message) = place(", \"log2.csv\"]", "]");
    assert_eq!(
        (line, message.contains("test by `halves`")),
        (9, true),
        "{message}"
    );
    let (line, message) = place("@7.5-8", "@8-7.5");
    assert_eq!(
        (line, message.contains("an interval starts")),
        (11, true),
        "{message}"
    );
    let (line, message) = place(RIGS, &format!("{RIGS}{}", RIGS.replace("plain =", "#")));
    assert_eq!(
        (line, message.contains("give another name")),
        (17, true),
        "{message}"
    );
}

#[test]
fn what_the_models_and_logs_of_a_rig_lack_is_told() {
    for (from, to, part) in [
        (
            "C_i = 5.0",
            "J = 5.0",
            "rig: pendulum has no parameter `J`; it has C_g, C_i",
        ),
        ("coulomb_friction", "coulomb", "unknown effect `coulomb`"),
        ("log2.csv@", "log9.csv@", "no log is called \"log9.csv\""),
        (
            "\"logs\"",
            "\"other\"",
            "give the folder of measured logs with --data",
        ),
        ("\"log3.csv\"", "\"log9.csv\"", "log9.csv"),
        (
            "model = \"pendulum\"\nparameters",
            "model = \"pendulam\"\nparameters",
            "pendulam",
        ),
    ] {
        let message = Bench::new(&RIGS.replace(from, to)).refused();
        assert!(message.contains(part), "{to}: {message}");
    }
    let message = refuses(&[
        "bench",
        "rigs",
        "--rigs",
        "no-such-file.toml",
        "--data",
        ".",
    ]);
    assert!(
        message.contains("give a file of rigs with --rigs"),
        "{message}"
    );
    let message = refuses(&[
        "bench",
        "rigs",
        "--data",
        ".",
        "--only",
        "nothing-of-the-kind",
    ]);
    assert!(message.contains("no rig's name contains"), "{message}");
}
