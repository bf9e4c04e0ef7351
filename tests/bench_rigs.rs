//! The comparison on measured rigs: its file, and a small rig of simulated logs end to end.

use std::env;

use residyn::read_model;
use residyn_core::closeloop::Settings;
use residyn_core::model::Library;
use residyn_formats::ClientError;
use residyn_validation::rigs::{
    Fold, Line, LogErrors, Measured, Method, RigsError, Squares, Task, Tools, errors_on, read,
    summarise,
};
use serde_json::Value;

use crate::support::bench::{COMMAND, RIGS, bench};
use crate::support::paths::config;
use crate::support::tables::rows;
use crate::support::{Scratch, replaced, says};

/// Error of a model in a row, 0.5 s ahead \[rad\].
fn error(row: &Value, model: &str) -> f64 {
    let models = row["models"].as_array().unwrap();
    let entry = models.iter().find(|entry| entry["model"] == model).unwrap();
    entry["pooled"][1]["position_rms"].as_f64().unwrap()
}

/// The first rig of a bench.
fn opened(bench: &Scratch) -> Measured {
    let rig = read(&bench.path("rigs.toml")).unwrap().remove(0);
    Measured::open(rig, bench.folder(), &Library::built_in()).unwrap()
}

#[test]
fn results_of_other_logs_or_models_are_not_used_again() {
    let bench = bench(RIGS);
    let fingerprint = || opened(&bench).fingerprint;
    let first = fingerprint();
    assert_eq!(first, fingerprint());
    let log = bench.read("logs/log4.csv");
    let shorter = log.trim_end().rsplit_once('\n').unwrap().0;
    bench.file("logs/log4.csv", shorter);
    let second = fingerprint();
    bench.file("rigs.toml", RIGS.replace("5.0", "5.1"));
    assert!(first != second && second != fingerprint());
}

#[test]
fn the_rigs_of_the_repository_are_read() {
    let rigs = read(config("bench/rigs.toml").as_ref()).unwrap();
    let names: Vec<&str> = rigs.iter().map(|rig| rig.name.as_str()).collect();
    assert_eq!(names.len(), 17, "{names:?}");
    let library = Library::built_in();
    for rig in &rigs {
        let sets = rig.published.iter().map(|set| &set.model);
        for declared in sets.chain([&rig.declared]) {
            let model = read_model(&declared.model, &library).unwrap();
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

/// A text of the file, what stands there instead, the line that is named, and words of the message.
const WRONG: &str = r#"
folder =                       | folders =  | 6  | unknown field `folders`, expected one of
, "log2.csv", "log3.csv"]      | ]          | 9  | test by `halves`
@7.5-8                         | @8-7.5     | 11 | an interval starts
"#;

#[test]
fn a_wrong_file_of_rigs_is_refused_with_the_line_and_a_remedy() {
    let scratch = Scratch::new();
    let place = |rigs: String| {
        scratch.file("rigs.toml", rigs);
        match read(&scratch.path("rigs.toml")).unwrap_err() {
            RigsError::File { line, message, .. } => (line.to_string(), message),
            other => panic!("{other}"),
        }
    };
    for [from, to, wanted, words] in rows(WRONG) {
        let (line, message) = place(replaced(RIGS, &from, &to));
        assert_eq!(line, wanted, "{message}");
        says(&message, &[&words]);
    }
    let (line, message) = place(RIGS.to_owned() + &RIGS.replace("plain =", "#"));
    assert_eq!(line, "17", "{message}");
    says(&message, &["give another name"]);
}

/// A text of the file, what stands there instead, and words of the message.
const LACKING: &str = r#"
C_i = 5.0                      | J = 5.0        | rig: pendulum has no parameter `J`; it has C_g, C_i
coulomb_friction               | coulomb        | unknown effect `coulomb`
log2.csv@                      | log9.csv@      | no log is called "log9.csv"
"logs"                         | "other"        | give the folder of measured logs with --data
"log4.csv"                     | "log9.csv"     | log9.csv
model = "pendulum"\nparameters | model = "pendulam"\nparameters | pendulam
"#;

#[test]
fn what_the_models_and_logs_of_a_rig_lack_is_reported() {
    for [from, to, words] in rows(LACKING) {
        let bench = bench(&RIGS.replace(&from, &to));
        says(&bench.refuses(COMMAND), &[&words]);
    }
    for [flags, words] in rows(
        "--rigs no-such-file.toml --data .       | give a file of rigs with --rigs
         --rigs $REPO/configs/bench/rigs.toml --data . --only nothing-of-the-kind | no rig's name contains",
    ) {
        let message = Scratch::new().refuses(&format!("bench rigs {flags}"));
        says(&message, &[&words]);
    }
}

mod slow {
    use super::*;

    #[test]
    fn each_log_is_left_out_in_turn_and_the_errors_are_pooled() {
        let bench = bench(RIGS);
        let (rig, library) = (opened(&bench), Library::built_in());
        let tools = Tools {
            library: &library,
            learner: None,
            seed: 0,
        };
        let run = |(fold, method): (&Fold, Method)| Line {
            rig: rig.rig.name.clone(),
            fold: fold.name.clone(),
            method,
            fingerprint: method.fingerprint(&rig, fold, 0, ""),
            seconds: 1.0,
            found: Ok(method.run(&rig, fold, &tools, &()).unwrap()),
        };
        // Python has its own test.
        let here = Method::ALL
            .into_iter()
            .filter(|method| *method != Method::MujocoSysid);
        let work = rig
            .folds
            .iter()
            .flat_map(|fold| here.clone().map(move |method| (fold, method)));
        let lines: Vec<Line> = work.map(run).collect();
        let summary = summarise(std::slice::from_ref(&rig), &lines, [].into());
        let summary = serde_json::to_value(summary).unwrap();
        let rows = summary["rows"].as_array().unwrap();
        assert_eq!(
            (rows.len(), &rows[0]["folds"], &rows[1]["folds"]),
            (2, &3.into(), &1.into())
        );
        assert_eq!(rows[1]["group"], "fourth");
        for row in rows {
            assert_eq!(row["named"]["coulomb_friction@1"], row["folds"], "{row}");
            let (after, plain) = (error(row, "after"), error(row, "plain structure"));
            assert!(after < 1.02 * plain, "{after} {plain}");
            for frictionless in ["declared, fitted", "published 1.0"] {
                assert!(after < 0.2 * error(row, frictionless), "{row}");
            }
            let best = row["best"][0].as_str().unwrap();
            assert!(["usual friction", "plain structure"].contains(&best));
            assert_eq!(row["hybrid_ratio"], 1.0);
        }
        let folds = summary["folds"].as_array().unwrap();
        assert_eq!(folds.len(), 4);
        for fold in folds {
            let models: Vec<&Value> = fold["simpler"].as_array().unwrap().iter().collect();
            let names: Vec<&Value> = models.iter().map(|model| &model["model"]).collect();
            let all = ["declared, fitted", "usual friction", "plain structure"];
            assert_eq!(names, all);
            // The effect that is named lowers the error by far more than its windows differ.
            assert!(models[0]["above"].as_f64().unwrap() < -3.0, "{fold}");
        }
        let logs = &rows[0]["models"][0]["logs"];
        assert_eq!(
            (&logs[0][0], &logs[1][0]),
            (&"log1.csv".into(), &"log2.csv".into())
        );
        let windows = |log: usize| logs[log][1][1]["windows"].as_u64().unwrap();
        assert!(windows(1) < windows(0), "left-out windows are not scored");
    }

    #[test]
    fn halves_train_and_test_and_a_failed_fold_is_never_a_success() {
        let bench = bench(&RIGS.replace("each_log", "halves").replace("also", "#"));
        let summary = bench.json(COMMAND);
        assert_eq!(summary["rows"].as_array().unwrap().len(), 1);
        assert_eq!(summary["rows"][0]["folds"], 2);
        let path = "out/rig/first half/closeloop.json";
        let mut line = bench.read_json(path);
        line["found"] = serde_json::json!({"Err": "the fit diverged"});
        bench.file(path, line.to_string());
        // Stored results are reused.
        let output = bench.run(&format!("{COMMAND} --json"));
        assert_eq!(output.status.code(), Some(1));
        let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(summary["failures"][0][2], "the fit diverged");
        assert_eq!(summary["rows"][0]["ratio"], Value::Null);
        says(
            &bench.read("out/rigs.md"),
            &[
                "| 1 failed | 1 failed | - |",
                "in 0, at most 0.9 of it in 0",
            ],
        );
        crate::support::clients::look_at(&bench.path("out/report.html"));
    }

    #[test]
    fn mujoco_predicts_as_the_program_does_and_its_toolbox_finds_the_friction() {
        let bench = bench(RIGS);
        let rig = opened(&bench);
        let (fold, (_, model)) = (&rig.folds[0], &rig.published[0]);
        let rms = |errors: &[LogErrors]| errors[0].iter().map(Squares::rms).collect::<Vec<f64>>();
        let task = Task::new(model, &[], &fold.test).unwrap();
        let predicted = match task.run() {
            Err(error) if error.is::<ClientError>() && env::var_os("RESIDYN_PYTHON").is_none() => {
                eprintln!("SKIPPED mujoco.sysid: {error}");
                return;
            }
            predicted => rms(&predicted.unwrap()),
        };
        let expected = rms(&errors_on(&model.dynamics(), &fold.test));
        // MuJoCo's integrator is of first order: over a time t its steps h err by a h t / 2, where a is gravity's
        // largest acceleration and steps are 2 ms.
        let horizons_s = Settings::default().score.horizons_s;
        for ((predicted, expected), horizon_s) in predicted.iter().zip(&expected).zip(horizons_s) {
            let stepping = 0.5 * 19.62 * 2e-3 * horizon_s;
            assert!(
                (predicted - expected).abs() < 0.02 * expected + stepping.min(0.1 * expected),
                "{predicted} {expected}"
            );
        }
        let fitted = Task::new(&rig.declared, &fold.train, &fold.test).unwrap();
        let fitted = rms(&fitted.run().unwrap());
        assert!(fitted[1] < 0.3 * expected[1], "{fitted:?} {expected:?}");
    }
}
