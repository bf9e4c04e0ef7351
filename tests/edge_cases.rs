//! Odd but valid input: every outcome is an answer or one clear error, and no number that is not finite goes
//! unmentioned.

use std::fs;
use std::path::Path;
use std::process::Command;

use residyn::{Library, Origin};
use residyn_core::closeloop::{Request, close_loop};
use residyn_report as report;
use residyn_train::ResidualTrainer;
use serde_json::Value;

use crate::support::catalogue::{rng, system};
use crate::support::logs::simulate;
use crate::support::{
    Scratch, answers, ends_without, refuses, residyn, says, succeeds, swinging, text,
};

const PENDULUM_OF_TORQUES: &str = r#"
[system]
name = "rod"
joints = 1

[parameters]
I = { value = 0.3, unit = "kg m^2" }
G = { value = 3.0, unit = "N m" }

[dynamics]
mass = [["I"]]
bias = ["G * sin(q1)"]
"#;

/// The output of `closeloop`, whose report can be read again.
fn closed(scratch: &Scratch, arguments: &[&str]) -> String {
    let out = scratch.out();
    let message = answers(&[&["closeloop", "--budget", "0s", "--out", &out], arguments].concat());
    succeeds(&["report", &out]);
    message
}

#[test]
fn a_network_that_diverges_leaves_the_report_without_one() {
    let model = system("pendulum");
    let logs = (0..4).map(|seed| simulate(&model.dynamics(), &[0.3, 0.0], 2.0, 600, seed));
    let library = Library::empty();
    let mut request = Request::of(&model, &library, logs.collect());
    let learner = ResidualTrainer::default();
    request.learner = Some(&learner);
    request.settings.learn.learning_rate = 1e9;
    let outcome = close_loop(request, &mut rng(0), &()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    report::write(folder.path(), &outcome, &Origin::of_seed(0)).unwrap();
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let json: Value = serde_json::from_str(&read("report.json")).unwrap();
    let failure = json["network"]["failure"].as_str().unwrap();
    says(failure, &["the loss became", "in epoch "]);
    assert_eq!(json["network"]["used"], false);
    // The network that adds nothing is evaluated with other operations.
    let error = |model: &str| {
        json["error"][model]["position_rmse"][1][0]
            .as_f64()
            .unwrap()
    };
    assert!((error("hybrid") / error("after") - 1.0).abs() < 1e-6);
    says(
        &read("report.md"),
        &[
            "The training of a residual network failed (the loss became",
            "is the one without a network",
        ],
    );
    says(
        &read("report.html"),
        &["The training of a residual network failed"],
    );
    assert!(folder.path().join("checkpoint").is_dir());
    succeeds(&["report", text(folder.path())]);
}

#[test]
fn logs_of_few_and_far_rows_get_an_answer() {
    let scratch = Scratch::new();
    let torques = scratch.file("torques.toml", PENDULUM_OF_TORQUES);
    let log = scratch.log("log.csv", swinging);
    // The fit's windows are shorter than a step of this log.
    let sparse = scratch.log_at(
        "sparse.csv",
        (0..40).map(|row| 0.5 * f64::from(row)),
        swinging,
    );
    let short = scratch.log_at(
        "short.csv",
        (0..60).map(|row| 0.01 * f64::from(row)),
        swinging,
    );
    let out = scratch.out();
    let message = refuses(&[
        "closeloop",
        "--model",
        "pendulum",
        "--train",
        &sparse,
        "--out",
        &out,
    ]);
    says(&message, &["the logs contain no window to fit"]);
    closed(
        &scratch,
        &["--model", "pendulum", "--train", &log, "--test", &sparse],
    );
    closed(
        &scratch,
        &[
            "--model", &torques, "--train", &sparse, "--errors", "torque",
        ],
    );
    // No row of the test log is half a second from both its ends.
    closed(
        &scratch,
        &["--model", &torques, "--train", &log, "--test", &short],
    );
    for rows in 0..5 {
        let few = scratch.log_at(
            "few.csv",
            (0..rows).map(|row| 0.01 * f64::from(row)),
            swinging,
        );
        for command in [
            &["audit"][..],
            &["evaluate", "--model", "pendulum", "--test"],
        ] {
            let status = residyn(&[command, &[&few]].concat()).status.code();
            assert!(
                matches!(status, Some(1 | 2)),
                "{command:?}, {rows} rows: {status:?}"
            );
        }
    }
}

#[test]
fn clocks_that_no_log_has_are_refused_with_their_line() {
    let scratch = Scratch::new();
    let steps = |row: u32| 0.01 * f64::from(row);
    let late = scratch.log_at(
        "late.csv",
        (0..200).map(|row| 1.7e18 + 1e9 * steps(row)),
        swinging,
    );
    let message = refuses(&["audit", &late]);
    says(
        &message,
        &[
            "late.csv, line 2",
            "1.7e18 s is beyond 1e12 s",
            "unit = \"ns\"",
        ],
    );
    let pause = |row: u32| steps(row) + if row < 100 { 0.0 } else { 1e9 };
    let paused = scratch.log_at("paused.csv", (0..200).map(pause), swinging);
    let message = refuses(&["audit", &paused]);
    says(
        &message,
        &[
            "paused.csv, line 102",
            "time jumps by 1",
            "from line 101",
            "cut the file there",
        ],
    );
    // A pause of an hour is accepted.
    let hour = |row: u32| steps(row) + if row < 100 { 0.0 } else { 3600.0 };
    answers(&[
        "audit",
        &scratch.log_at("hour.csv", (0..200).map(hour), swinging),
    ]);
}

#[test]
fn torques_of_any_size_are_told_in_numbers() {
    let scratch = Scratch::new();
    let torques = scratch.file("torques.toml", PENDULUM_OF_TORQUES);
    let tiny = |time: f64| swinging(time).map(|number| 1e-200 * number);
    let message = answers(&["audit", &scratch.log("tiny.csv", tiny)]);
    assert!(!message.contains("NaN"), "{message}");
    let passive = scratch.log("passive.csv", |time| {
        let [q, qd, _] = swinging(time);
        [q, qd, 0.0]
    });
    let message = succeeds(&[
        "evaluate", "--model", &torques, "--test", &passive, "--torque",
    ]);
    says(&message, &["no percentage, the logged torques are zero"]);
    let logs = ["--train", &passive, "--test", &passive];
    closed(
        &scratch,
        &[&["--model", &torques, "--errors", "torque"][..], &logs].concat(),
    );
    let heavy = PENDULUM_OF_TORQUES.replace("value = 0.3", "value = 1e300");
    let heavy = scratch.file("heavy.toml", heavy);
    let message = ends_without(&[
        "evaluate", "--model", &heavy, "--test", &passive, "--torque",
    ]);
    says(&message, &["the torques that rod needs", "are not finite"]);
}

#[test]
fn what_the_logs_do_not_determine_has_no_end_in_the_report() {
    let scratch = Scratch::new();
    // Too few windows to determine two parameters.
    let log = scratch.log("log.csv", |time| {
        let [q, qd, _] = swinging(time);
        [q, qd, 1.0]
    });
    closed(&scratch, &["--model", "pendulum", "--train", &log]);
    let report = fs::read_to_string(scratch.path("out/report.md")).unwrap();
    says(&report, &["any value: these logs do not bound it"]);
    assert!(
        !report.contains("inf ") && !report.contains("NaN"),
        "{report}"
    );
}

#[test]
fn formulas_that_are_no_finite_number_are_refused_with_their_place() {
    let scratch = Scratch::new();
    for (formula, message) in [
        ("1e200 * 1e200 * q1", "this is inf, not a finite number"),
        ("log(0) + q1", "this is -inf"),
        ("sqrt(1 - 2) * q1", "this is NaN"),
        ("q1 / (1 - 1)", "this divides by zero"),
    ] {
        let model = scratch.moving_by("model.toml", formula);
        says(
            &refuses(&["check", &model]),
            &["model.toml, line 11", message],
        );
    }
}

#[test]
fn steps_of_any_length_are_exported_or_refused() {
    let scratch = Scratch::new();
    let out = text(&scratch.path("out.json")).to_owned();
    let usual = [
        "export", "--model", "pendulum", "--format", "json", "--out", &out,
    ];
    for step in ["1e-300", "1e-6", "100"] {
        succeeds(&[&usual[..], &["--step", step]].concat());
    }
    let unstable = scratch.moving_by("unstable.toml", "1e6 * q1 + C_g * sin(q1) + C_i * tau1");
    let output = residyn(&[
        "export", "--model", &unstable, "--format", "json", "--out", &out,
    ]);
    assert!(output.status.success());
    let message = String::from_utf8_lossy(&output.stderr);
    says(
        &message,
        &["note: the rollout is no longer finite in step "],
    );
    let output = residyn(&[&usual[..], &["--step", "1e300"]].concat());
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stdout);
    says(
        &message,
        &["the model itself is not finite in a step of 1e300 s from the state ["],
    );
    for substeps in ["fine:1001", "fine:4294967295"] {
        let message = refuses(&[&usual[..], &["--integrator", substeps]].concat());
        says(&message, &["at most 1000 substeps"]);
    }
    let delay = "\n[[effect]]\nname = \"actuator_delay\"\njoint = 1\nd = 0.02\n";
    let delayed = scratch.file(
        "delayed.toml",
        include_str!("../models/pendulum.toml").to_owned() + delay,
    );
    let line = [
        "export", "--model", &delayed, "--format", "json", "--out", &out, "--step", "1e-9",
    ];
    says(
        &refuses(&line),
        &["the delay of joint 1 is 0.02 s", "at most 10000 steps"],
    );
    let heavy = scratch.model("heavy.toml", "value = 15.0", "value = 1e300");
    let line = [
        "export", "--model", &heavy, "--format", "onnx", "--out", &out,
    ];
    says(&refuses(&line), &["1e300 is beyond single precision"]);
}

#[test]
fn rigs_and_tasks_beyond_any_sensor_are_refused() {
    let scratch = Scratch::new();
    let out = scratch.out();
    let beyond = "numbers up to 1e30 are accepted";
    for (from, to) in [
        (
            "position = [[-3.141592653589793, 3.141592653589793]]",
            "position = [[-1e308, 1e308]]",
        ),
        ("torque = [[-3.0, 3.0]]", "torque = [[0, 1e300]]"),
    ] {
        let recipe = scratch.changed("smoke/train-pendulum.toml", from, to);
        says(
            &refuses(&["train", "--config", &recipe, "--out", &out]),
            &[beyond],
        );
    }
    let plant = ["control", "--model", "pendulum", "--plant", "pendulum-sim"];
    for flags in [
        &["--torque", "inf"][..],
        &["--start", "1e300", "0"],
        &["--noise", "1e300", "0"],
    ] {
        says(&refuses(&[&plant, flags].concat()), &[beyond]);
    }
    let recipe = scratch.changed(
        "smoke/train-pendulum.toml",
        "penalty = { fixed = { alpha = 1e-4 } }\nintegrator = \"semi_implicit_euler\"",
        "integrator = { fine = { steps = 4294967295 } }",
    );
    let message = refuses(&["train", "--config", &recipe, "--out", &out]);
    says(&message, &["at most 1000 substeps"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn effects_are_taken_out_of_a_model_wherever_they_stand() {
    let scratch = Scratch::new();
    let log = scratch.log("log.csv", swinging);
    let effect = "name = \"coulomb_friction\"\njoint = 1\nF_c = 0.1\n";
    let inline = effect.trim_end().replace('\n', ", ");
    let about = "name = \"rod\"\nabout = \"\"\"\n[[effect]]\n\"\"\"";
    for described in [
        PENDULUM_OF_TORQUES.replace("name = \"rod\"", about),
        format!("effect = [{{ {inline} }}]\n{PENDULUM_OF_TORQUES}"),
        format!("[[effect]]\n{effect}{PENDULUM_OF_TORQUES}"),
    ] {
        let model = scratch.file("model.toml", described);
        closed(&scratch, &["--model", &model, "--train", &log]);
        let written = scratch.path("out/model.toml");
        succeeds(&["evaluate", "--model", text(&written), "--test", &log]);
    }
}

#[test]
fn effects_without_parameters_have_none_to_set() {
    let scratch = Scratch::new();
    fs::create_dir(scratch.path("own")).unwrap();
    scratch.file(
        "own/push.toml",
        "[effect]\nname = \"push\"\nabout = \"a push\"\nforce = \"0.1 * cos(q)\"\n\n[parameters]\n",
    );
    let (own, out) = (scratch.path("own"), scratch.out());
    let usual = [
        "simulate",
        "--plant",
        "pendulum",
        "--out",
        &out,
        "--effects",
        text(&own),
    ];
    let message = refuses(&[&usual[..], &["--effect", "push=1"]].concat());
    says(&message, &["push has no parameter"]);
}

#[test]
fn rewards_and_plans_that_are_no_finite_numbers_end_control() {
    let scratch = Scratch::new();
    let control = |objective: &str| {
        let task = scratch.changed("tasks/pendulum.toml", "objective = \"cos(q1)\"", objective);
        ends_without(&[
            "control",
            "--model",
            "pendulum",
            "--plant",
            "pendulum-sim",
            "--task",
            &task,
        ])
    };
    says(
        &control("objective = \"log(q1 - 100)\""),
        &["the objective of the task is NaN in the state at 0.020 s"],
    );
    // Double precision can represent these numbers, but the single precision of plans cannot.
    says(
        &control("objective = \"1e300 * (1 + q1^2)\""),
        &[
            "10 of 10 plan(s) failed",
            "in episode 0 at 0.000 s",
            "no candidate has a finite return",
        ],
    );
}

/// A mass whose inverse is infinite: dividing by it overflows.
#[test]
fn a_mass_too_small_for_its_inverse_is_no_mechanism() {
    let scratch = Scratch::new();
    let light = "[system]\nname = \"axis\"\njoints = 1\nprismatic = [1]\n\
                 [parameters]\nm = { value = 1e-320, unit = \"kg\" }\n\
                 [dynamics]\nmass = [[\"m\"]]\nbias = [\"0\"]\n";
    let model = scratch.file("light.toml", light);
    for format in ["mjcf", "urdf"] {
        let out = text(&scratch.path("light.xml")).to_owned();
        let export = ["export", "--model", &model, "--format", format];
        let message = refuses(&[&export[..], &["--out", &out]].concat());
        says(&message, &["too small or too large"]);
    }
}

#[test]
fn plans_that_are_no_finite_numbers_end_a_run_of_learning() {
    let scratch = Scratch::new();
    let infinite = "objective = \"1e300 * (1 + q1^2)\"";
    scratch.changed("tasks/pendulum.toml", "objective = \"cos(q1)\"", infinite);
    let own = "task = \"pendulum.toml\"";
    let config = scratch.changed(
        "smoke/physics-prior-pendulum.toml",
        "task = \"pendulum\"",
        own,
    );
    for command in [&["mbrl"][..], &["experiment", "physics-prior"]] {
        let out = scratch.path(command[0]);
        let run = ["--config", &config, "--out", text(&out)];
        says(
            &ends_without(&[command, &run].concat()),
            &["no candidate plan at 0.000 s has a finite return"],
        );
    }
}

mod slow {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn equations_of_many_terms_are_printed_in_little_memory() {
        let scratch = Scratch::new();
        let sum = |first: usize| -> String {
            let terms = (first..first + 15).map(|k| format!("q1 * {}", k + 2));
            format!("sin({})", terms.collect::<Vec<_>>().join(" + "))
        };
        let sums: Vec<String> = (0..300).map(|k| sum(20 * k)).collect();
        let model = scratch.moving_by("model.toml", &(sums.join(" + ") + " + C_i * tau1"));
        for (format, out) in [
            ("c", "model.h"),
            ("python", "model.py"),
            ("latex", "model.tex"),
        ] {
            let out = scratch.path(out);
            // Without a compiler, which would need memory as well.
            let output = Command::new("bash")
                .args(["-c", "ulimit -v 200000; exec \"$0\" \"$@\""])
                .arg(env!("CARGO_BIN_EXE_residyn"))
                .args([
                    "export",
                    "--model",
                    &model,
                    "--format",
                    format,
                    "--out",
                    text(&out),
                ])
                .envs([("CC", "none"), ("RESIDYN_PYTHON", "none")])
                .envs([("MALLOC_ARENA_MAX", "1"), ("RAYON_NUM_THREADS", "2")])
                .output()
                .unwrap();
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{format}: {message}");
            assert!(fs::metadata(out).unwrap().len() < 2_000_000);
        }
    }
}
