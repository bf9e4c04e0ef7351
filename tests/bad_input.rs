//! Bad input gives one clear error that names the place and the remedy, exit status 2, and no half-written files.

use std::fs;

use crate::support::{Scratch, refuses, residyn, says, succeeds, text};

const GOOD: &str = "time,q1,qd1,tau1\n0,0.1,0,0\n0.01,0.1,0,0\n0.02,0.1,0,0\n";

/// The output of closing the loop on a log; it must not create a folder.
fn closeloop(model: &str, log: &str) -> String {
    let scratch = Scratch::new();
    let (log, out) = (scratch.file("log.csv", log), scratch.out());
    let message = refuses(&[
        "closeloop",
        "--model",
        model,
        "--train",
        &log,
        "--out",
        &out,
    ]);
    assert!(!scratch.path("out").exists(), "a folder was left behind");
    message
}

#[test]
fn a_log_that_cannot_be_read_is_refused_with_its_place() {
    let cases: &[(&str, &[&str])] = &[
        ("", &["log.csv", "empty"]),
        ("time,q1,qd1,tau1\n", &["log.csv", "row"]),
        (
            "time,q1,qd1,tau1\n0,0.1,0,0\n",
            &["log.csv", "1 row(s)", "at least two"],
        ),
        (
            "time,q1,velocity,tau1\n0,1,2,3\n1,1,2,3\n",
            &["log.csv", "qd1", "[columns]"],
        ),
        (
            "time,q1,qd1,tau1\n0,abc,0,0\n1,0,0,0\n",
            &["log.csv, line 2", "q1", "\"abc\" is not a number"],
        ),
        (
            "time,q1,qd1,tau1\n0,NaN,0,0\n1,0,0,0\n",
            &["log.csv, line 2", "q1", "NaN"],
        ),
        (
            "time,q1,qd1,tau1\n0,0,0,0\n0,0,0,0\n",
            &["log.csv, line 3", "time"],
        ),
        (
            "time,q1,q2,qd1,qd2,tau1,tau2\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n",
            &["log.csv", "joint"],
        ),
        ("time,q1,qd1,tau1\n0,0,0\n1,0,0,0\n", &["log.csv, line 2"]),
    ];
    for (contents, parts) in cases {
        says(&closeloop("pendulum", contents), parts);
    }
}

#[test]
fn a_log_that_is_not_there_is_named() {
    says(
        &refuses(&["evaluate", "--model", "pendulum", "--test", "nowhere.csv"]),
        &["nowhere.csv"],
    );
}

#[test]
fn a_log_that_is_too_short_to_fit_says_so() {
    says(&closeloop("pendulum", GOOD), &["too short", "--test"]);
}

/// The error message for a pendulum model file with this change.
fn model_message(from: &str, to: &str) -> String {
    closeloop(&Scratch::new().model("model.toml", from, to), GOOD)
}

#[test]
fn errors_in_model_files_name_line_column_and_a_similar_name() {
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "C_g * sin",
            "C_q * sin",
            &[
                "model.toml, line 11, column 8",
                "unknown name `C_q`",
                "`C_g`",
                "^^^",
            ],
        ),
        (
            "sin(q1)",
            "sinus(q1)",
            &["line 11", "unknown function `sinus`", "`sin`"],
        ),
        ("sin(q1) +", "sin(q1 +", &["line 11", "never closed"]),
        (
            "sin(q1) +",
            "(2 sin(q1)) +",
            &["line 11", "expected an operator, or `)`, found `s`"],
        ),
        (
            "[dynamics]",
            "[dynamics.let]\na = \"2 * b\"\nb = \"q1\"\n\n[dynamics]",
            &[
                "line 11",
                "`a` uses `b`, which is defined after it; move it up",
            ],
        ),
        (
            "value = 15.0",
            "vlaue = 15.0",
            &["line 7", "unknown key `vlaue`", "`value`"],
        ),
        ("joints = 1", "joints = 1.5", &["line 4", "whole number"]),
        ("joints = 1", "joints = \"one\"", &["line 4", "a number"]),
        (
            "[dynamics]",
            "[dynamik]",
            &["unknown key `dynamik`", "`dynamics`"],
        ),
        ("name = \"pendulum\"", "name = pendulum", &["line 2"]),
        (
            "positive = true",
            "bounds = [5, 6]",
            &["line 8", "outside its bounds"],
        ),
    ];
    for (from, to, parts) in cases {
        says(&model_message(from, to), parts);
    }
}

#[test]
fn an_unknown_effect_in_a_model_file_suggests_a_similar_one() {
    let effect = "[[effect]]\nname = \"coulom_friction\"\njoint = 1\nF_c = 0.1\n\n[energy]";
    says(
        &model_message("[energy]", effect),
        &["unknown effect `coulom_friction`", "`coulomb_friction`"],
    );
    let joint = "[[effect]]\nname = \"coulomb_friction\"\njoint = 2\nF_c = 0.1\n\n[energy]";
    says(
        &model_message("[energy]", joint),
        &["`joint` must be a number from 1 to 1"],
    );
    let parameter = "[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nFc = 0.1\n\n[energy]";
    says(
        &model_message("[energy]", parameter),
        &["unknown key `Fc`", "`F_c`"],
    );
}

#[test]
fn an_effect_that_cannot_act_is_refused() {
    let effect = |text: &str| model_message("[energy]", &format!("[[effect]]\n{text}\n\n[energy]"));
    says(
        &effect("name = \"rotor_inertia\"\njoint = 1\nJ = 0.1"),
        &[
            "line 13",
            "`rotor_inertia` needs a model that gives `mass` and `bias`",
        ],
    );
    says(
        &effect("name = \"viscous_friction\"\njoint = 1\nb = -1"),
        &["b = -1 is outside 0 to inf"],
    );
    let twice = "name = \"viscous_friction\"\njoint = 1\nb = 1";
    says(
        &effect(&format!("{twice}\n[[effect]]\n{twice}")),
        &["already acts on joint 1"],
    );
    let late = "name = \"actuator_delay\"\njoint = 1\nd = 0.2";
    says(&effect(late), &["d = 0.2 is outside 0 to 0.1"]);
    says(
        &model_message("C_i = {", "tau1 = {"),
        &["the name `tau1` is taken"],
    );
}

#[test]
fn per_takes_no_value_but_log() {
    let contents = "[effect]\nname = \"zero\"\nabout = \"zero\"\nangle = \"q - z\"\n\n[parameters]\n\
                z = { unit = \"rad\", typical = 0.1, per = \"week\" }\n";
    let scratch = Scratch::new();
    scratch.file("zero.toml", contents);
    says(
        &refuses(&["list", "effects", "--effects", text(&scratch.path(""))]),
        &[
            "zero.toml, line 7, column 42",
            "`per` must be \"log\"",
            "\"week\"",
        ],
    );
}

#[test]
fn only_parameters_per_log_take_values_of_single_logs() {
    let effect = |text: &str| model_message("[energy]", &format!("[[effect]]\n{text}\n\n[energy]"));
    says(
        &effect("name = \"viscous_friction\"\njoint = 1\nb = { value = 1, logs = { a = 1 } }"),
        &["line 16, column 18", "unknown key `logs`"],
    );
    says(
        &effect("name = \"sensor_offset\"\njoint = 1\nq_z = { value = 0, logs = { a = 3 } }"),
        &["line 13", "q_z = 3 is outside -0.5 to 0.5"],
    );
}

#[test]
fn a_missing_model_is_answered_with_the_known_ones() {
    says(
        &closeloop("pendulun", GOOD),
        &[
            "pendulun",
            "acrobot, cartpole, drive, motor, pendulum, servo",
        ],
    );
}

#[test]
fn unknown_effects_and_parameters_of_a_simulation_are_named() {
    let simulate = |effect: &str| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("log.csv");
        let message = refuses(&[
            "simulate",
            "--plant",
            "pendulum",
            "--effect",
            effect,
            "--out",
            text(&out),
        ]);
        assert!(!out.exists());
        message
    };
    says(
        &simulate("coulomb=0.1"),
        &["unknown effect `coulomb`", "`coulomb_friction`"],
    );
    says(
        &simulate("coulomb_friction.F_d=0.1"),
        &["no parameter `F_d`", "`F_c`"],
    );
    says(
        &simulate("coulomb_friction@3=0.1"),
        &["`joint` must be from 1 to 1"],
    );
    says(
        &simulate("coulomb_friction=much"),
        &["\"much\" is not a number"],
    );
}

#[test]
fn leave_out_must_name_a_log_and_a_time() {
    let scratch = Scratch::new();
    let log = scratch.file("log.csv", GOOD);
    let ask = |span: &str| {
        refuses(&[
            "evaluate",
            "--model",
            "pendulum",
            "--test",
            &log,
            "--leave-out",
            span,
        ])
    };
    says(&ask("other.csv@0-1"), &["other.csv", "log.csv"]);
    says(&ask("log.csv@3-1"), &["3", "1"]);
    says(&ask("log.csv"), &["@"]);
}

#[test]
fn a_folder_that_is_no_checkpoint_is_refused() {
    let scratch = Scratch::new();
    let log = scratch.file("log.csv", GOOD);
    let evaluate = |dir: &str| refuses(&["evaluate", "--checkpoint", dir, "--test", &log]);
    says(&evaluate("nowhere"), &["nowhere"]);
    scratch.file("checkpoint.json", "{ not json");
    says(&evaluate(text(&scratch.path(""))), &["checkpoint.json"]);
}

/// Results that cannot be written, as on a full disk: every write fails with an error.
#[test]
#[cfg(unix)]
fn a_full_disk_leaves_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("log.csv");
    let command = format!(
        "trap '' XFSZ; ulimit -f 1; exec {} simulate --plant pendulum --out {}",
        env!("CARGO_BIN_EXE_residyn"),
        text(&out)
    );
    let output = std::process::Command::new("bash")
        .args(["-c", &command])
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    says(&message, &["log.csv"]);
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        0,
        "something was left behind"
    );
}

#[test]
fn a_folder_that_cannot_be_written_is_refused_before_the_work() {
    let scratch = Scratch::new();
    let file = scratch.file("a-file", "");
    let inside = scratch.path("a-file").join("report");
    says(
        &refuses(&["closeloop", "--out", text(&inside)]),
        &["a-file", "--out"],
    );
    says(
        &refuses(&["closeloop", "--out", &file]),
        &["is a file", "--out"],
    );
    let log = inside.join("log.csv");
    says(
        &refuses(&["simulate", "--plant", "pendulum", "--out", text(&log)]),
        &["a-file"],
    );
}

#[test]
fn a_rig_that_diverges_is_reported() {
    let pendulum = include_str!("../models/pendulum.toml")
        .replace("C_i * tau1", "C_i * tau1 + exp(abs(q1))^4");
    let scratch = Scratch::new();
    let model = scratch.file("model.toml", pendulum);
    let out = scratch.path("log.csv");
    let output = residyn(&["simulate", "--plant", &model, "--out", text(&out)]);
    assert_eq!(output.status.code(), Some(1));
    says(&String::from_utf8_lossy(&output.stderr), &["diverges"]);
    assert!(!out.exists());
}

#[test]
fn good_input_is_not_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("log.csv");
    succeeds(&[
        "simulate",
        "--plant",
        "pendulum",
        "--out",
        text(&out),
        "--duration",
        "3",
    ]);
    succeeds(&[
        "evaluate",
        "--model",
        "pendulum",
        "--test",
        text(&out),
        "--json",
    ]);
}

#[test]
fn an_error_states_its_cause_once() {
    let folder = tempfile::tempdir().unwrap();
    let (missing, out) = (folder.path().join("none.toml"), folder.path().join("out"));
    let paths = ["--config", text(&missing), "--out", text(&out)];
    for command in [&["train"][..], &["experiment", "physics-prior"]] {
        let message = refuses(&[command, &paths].concat());
        assert_eq!(message.matches("No such file").count(), 1, "{message}");
        says(&message, &["none.toml", "--config"]);
        assert!(!out.exists(), "a folder was left behind");
    }
}

#[test]
fn a_report_of_another_schema_is_refused_with_its_number() {
    let scratch = Scratch::new();
    let report = include_str!("golden/small_pendulum/report.json");
    assert!(report.contains("\"schema\": 2"));
    scratch.file(
        "report.json",
        report.replace("\"schema\": 2", "\"schema\": 1"),
    );
    says(
        &refuses(&["report", text(&scratch.path(""))]),
        &["it has schema 1", "reads schema 2", "make the report again"],
    );
}
