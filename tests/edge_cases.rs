//! Odd but valid input: every outcome is an answer or one clear error, and no number that is not finite goes
//! unmentioned.

use std::fs;

use residyn::{Library, Origin};
use residyn_core::closeloop::{Request, close_loop};
use residyn_report as report;
use residyn_train::ResidualTrainer;

use crate::support::catalogue::{rng, system};
use crate::support::logs::simulate;
use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says, swinging};

/// A pendulum that gives a mass and a bias, so that its motion is compared through its torques.
const ROD: &str = include_str!("fixtures/rod.toml");

/// The output of `closeloop`, whose report can be read again.
#[track_caller]
fn closed(scratch: &Scratch, given: &str) -> String {
    let said = scratch.answers(&format!("closeloop --budget 0s --out out {given}"));
    scratch.succeeds("report out");
    said
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
    let scratch = Scratch::new();
    report::write(scratch.folder(), &outcome, &Origin::of_seed(0)).unwrap();
    let json = scratch.read_json("report.json");
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
    let failed = "The training of a residual network failed";
    says(
        &scratch.read("report.md"),
        &[failed, " (the loss became", "is the one without a network"],
    );
    says(&scratch.read("report.html"), &[failed]);
    assert!(scratch.path("checkpoint").is_dir());
    scratch.succeeds("report .");
}

#[test]
fn logs_of_few_and_far_rows_get_an_answer() {
    let scratch = Scratch::new();
    let log_of = |name: &str, rows: u32, step_s: f64| {
        let times = (0..rows).map(|row| step_s * f64::from(row));
        scratch.log_at(name, times, swinging);
    };
    scratch.file("rod.toml", ROD);
    log_of("log.csv", 200, 0.01);
    // The fit's windows are shorter than a step of this log.
    log_of("sparse.csv", 40, 0.5);
    log_of("short.csv", 60, 0.01);
    let message = scratch.refuses("closeloop --model pendulum --train sparse.csv --out out");
    says(&message, &["the logs contain no window to fit"]);
    for given in [
        "--model pendulum --train log.csv --test sparse.csv",
        "--model rod.toml --train sparse.csv --errors torque",
        // No row of the test log is half a second from both its ends.
        "--model rod.toml --train log.csv --test short.csv",
    ] {
        closed(&scratch, given);
    }
    for rows in 0..5 {
        log_of("few.csv", rows, 0.01);
        for line in ["audit few.csv", "evaluate --model pendulum --test few.csv"] {
            let status = scratch.run(line).status.code();
            let is_told = matches!(status, Some(1 | 2));
            assert!(is_told, "{line}, {rows} rows: {status:?}");
        }
    }
}

#[test]
fn clocks_that_no_log_has_are_refused_with_their_line() {
    let scratch = Scratch::new();
    let steps = |row: u32| 0.01 * f64::from(row);
    let late = (0..200).map(|row| 1.7e18 + 1e9 * steps(row));
    scratch.log_at("late.csv", late, swinging);
    let paused =
        |pause_s: f64| (0..200).map(move |row| steps(row) + if row < 100 { 0.0 } else { pause_s });
    scratch.log_at("paused.csv", paused(1e9), swinging);
    for [line, words] in rows(
        r#"audit late.csv   | late.csv, line 2 ... 1.7e18 s is beyond 1e12 s ... unit = "ns"
           audit paused.csv | paused.csv, line 102 ... time jumps by 1 ... from line 101 ... cut the file there"#,
    ) {
        says_words(&scratch.refuses(&line), &words);
    }
    scratch.log_at("hour.csv", paused(3600.0), swinging);
    scratch.answers("audit hour.csv");
}

#[test]
fn torques_of_any_size_are_told_in_numbers() {
    let scratch = Scratch::new();
    scratch.file("rod.toml", ROD);
    scratch.log("tiny.csv", |time| swinging(time).map(|x| 1e-200 * x));
    let said = scratch.answers("audit tiny.csv");
    assert!(!said.contains("NaN"), "{said}");
    scratch.log("passive.csv", |time| {
        let [q, qd, _] = swinging(time);
        [q, qd, 0.0]
    });
    let said = scratch.succeeds("evaluate --model rod.toml --test passive.csv --torque");
    says(&said, &["no percentage, the logged torques are zero"]);
    closed(
        &scratch,
        "--model rod.toml --errors torque --train passive.csv --test passive.csv",
    );
    scratch.file("heavy.toml", ROD.replace("value = 0.3", "value = 1e300"));
    let said = scratch.ends_without("evaluate --model heavy.toml --test passive.csv --torque");
    says(&said, &["the torques that rod needs", "are not finite"]);
}

#[test]
fn what_the_logs_do_not_determine_has_no_end_in_the_report() {
    let scratch = Scratch::new();
    // Too few windows to determine two parameters.
    scratch.log("log.csv", |time| {
        let [q, qd, _] = swinging(time);
        [q, qd, 1.0]
    });
    closed(&scratch, "--model pendulum --train log.csv");
    let report = scratch.read("out/report.md");
    says(&report, &["any value: these logs do not bound it"]);
    assert!(
        !report.contains("inf ") && !report.contains("NaN"),
        "{report}"
    );
}

/// An acceleration of the pendulum, and words of the message.
const FORMULAS: &str = "
1e200 * 1e200 * q1 | this is inf, not a finite number
log(0) + q1        | this is -inf
sqrt(1 - 2) * q1   | this is NaN
q1 / (1 - 1)       | this divides by zero
";

#[test]
fn formulas_that_are_no_finite_number_are_refused_with_their_place() {
    let scratch = Scratch::new();
    for [formula, words] in rows(FORMULAS) {
        scratch.moving_by("model.toml", &formula);
        let message = scratch.refuses("check model.toml");
        says(&message, &["model.toml, line 11", &words]);
    }
}

#[test]
fn steps_of_any_length_are_exported_or_refused() {
    let scratch = Scratch::new();
    let export = |model: &str, more: &str| {
        scratch.run(&format!(
            "export --model {model} --format json --out out.json {more}"
        ))
    };
    for step in ["1e-300", "1e-6", "100"] {
        let output = export("pendulum", &format!("--step {step}"));
        assert!(output.status.success(), "{step}");
    }
    scratch.moving_by("unstable.toml", "1e6 * q1 + C_g * sin(q1) + C_i * tau1");
    let output = export("unstable.toml", "");
    assert!(output.status.success());
    says(
        &String::from_utf8_lossy(&output.stderr),
        &["note: the rollout is no longer finite in step "],
    );
    let output = export("pendulum", "--step 1e300");
    assert_eq!(output.status.code(), Some(1));
    says(
        &String::from_utf8_lossy(&output.stdout),
        &["the model itself is not finite in a step of 1e300 s from the state ["],
    );
    let delay = "[[effect]]\nname = \"actuator_delay\"\njoint = 1\nd = 0.02\n\n[energy]";
    scratch.model("delayed.toml", "[energy]", delay);
    scratch.model("heavy.toml", "value = 15.0", "value = 1e300");
    for [given, words] in rows(
        "--model pendulum --format json --integrator fine:1001       | at most 1000 substeps
         --model pendulum --format json --integrator fine:4294967295 | at most 1000 substeps
         --model delayed.toml --format json --step 1e-9 | the delay of joint 1 is 0.02 s ... at most 10000 steps ... steps of 1e-9 s are remembered ... set it with --step
         --model heavy.toml --format onnx               | 1e300 is beyond single precision",
    ) {
        says_words(
            &scratch.refuses(&format!("export {given} --out out.json")),
            &words,
        );
    }
}

/// A text of a recipe, what stands there instead, and words of the message.
const RECIPES: &str = r#"
position = [[-3.141592653589793, 3.141592653589793]] | position = [[-1e308, 1e308]] | numbers up to 1e30 are accepted
torque = [[-3.0, 3.0]] | torque = [[0, 1e300]] | numbers up to 1e30 are accepted
penalty = { fixed = { alpha = 1e-4 } }\nintegrator = "semi_implicit_euler" | integrator = { fine = { steps = 4294967295 } } | at most 1000 substeps
"#;

#[test]
fn rigs_and_tasks_beyond_any_sensor_are_refused() {
    let scratch = Scratch::new();
    for [from, to, words] in rows(RECIPES) {
        scratch.changed("smoke/train-pendulum.toml", &from, &to);
        let message = scratch.refuses("train --config train-pendulum.toml --out out");
        says(&message, &[&words]);
    }
    assert!(!scratch.has("out"));
    for flags in ["--torque inf", "--start 1e300 0", "--noise 1e300 0"] {
        let control = "control --model pendulum --plant pendulum-sim";
        let message = scratch.refuses(&format!("{control} {flags}"));
        says(&message, &["numbers up to 1e30 are accepted"]);
    }
}

#[test]
fn effects_are_taken_out_of_a_model_wherever_they_stand() {
    let scratch = Scratch::new();
    scratch.log("log.csv", swinging);
    let effect = "name = \"coulomb_friction\"\njoint = 1\nF_c = 0.1\n";
    let inline = effect.trim_end().replace('\n', ", ");
    let about = "name = \"rod\"\nabout = \"\"\"\n[[effect]]\n\"\"\"";
    for described in [
        ROD.replace("name = \"rod\"", about),
        format!("effect = [{{ {inline} }}]\n{ROD}"),
        format!("[[effect]]\n{effect}{ROD}"),
    ] {
        scratch.file("model.toml", described);
        closed(&scratch, "--model model.toml --train log.csv");
        scratch.succeeds("evaluate --model out/model.toml --test log.csv");
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
    let line = "simulate --plant pendulum --out out --effects own --effect push=1";
    says(&scratch.refuses(line), &["push has no parameter"]);
}

#[test]
fn rewards_and_plans_that_are_no_finite_numbers_end_control() {
    let scratch = Scratch::new();
    // Double precision can represent the second objective, but the single precision of plans cannot.
    for [objective, words] in rows(
        r#"objective = "log(q1 - 100)" | the objective of the task is NaN in the state at 0.020 s
           objective = "1e300 * (1 + q1^2)" | 500 of 500 plan(s) failed ... in episode 0 at 0.000 s ... no candidate has a finite return"#,
    ) {
        scratch.changed("tasks/pendulum.toml", "objective = \"cos(q1)\"", &objective);
        let line = "control --model pendulum --plant pendulum-sim --task pendulum.toml";
        says_words(&scratch.ends_without(line), &words);
    }
}

/// A mass whose inverse is infinite: dividing by it overflows.
#[test]
fn a_mass_too_small_for_its_inverse_is_no_mechanism() {
    let scratch = Scratch::new();
    let light = "[system]\nname = \"axis\"\njoints = 1\nprismatic = [1]\n\
                 [parameters]\nm = { value = 1e-320, unit = \"kg\" }\n\
                 [dynamics]\nmass = [[\"m\"]]\nbias = [\"0\"]\n";
    scratch.file("light.toml", light);
    for format in ["mjcf", "urdf"] {
        let line = format!("export --model light.toml --format {format} --out light.xml");
        says(&scratch.refuses(&line), &["too small or too large"]);
    }
}

#[test]
fn plans_that_are_no_finite_numbers_end_a_run_of_learning() {
    let scratch = Scratch::new();
    let infinite = "objective = \"1e300 * (1 + q1^2)\"";
    scratch.changed("tasks/pendulum.toml", "objective = \"cos(q1)\"", infinite);
    let own = "task = \"pendulum.toml\"";
    scratch.changed(
        "smoke/physics-prior-pendulum.toml",
        "task = \"pendulum\"",
        own,
    );
    for (command, out) in [("mbrl", "a"), ("experiment physics-prior", "b")] {
        let given = format!("--config physics-prior-pendulum.toml --out {out}");
        says(
            &scratch.ends_without(&format!("{command} {given}")),
            &["no candidate plan at 0.000 s has a finite return"],
        );
    }
}

mod slow {
    #[cfg(unix)]
    use crate::support::within;

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
        for (format, name) in [
            ("c", "model.h"),
            ("python", "model.py"),
            ("latex", "model.tex"),
        ] {
            let out = scratch.path(name);
            let export = ["export", "--model", &model, "--format", format, "--out"];
            // Without a compiler, which would need memory as well.
            let output = within(200_000)
                .args(export)
                .arg(&out)
                .envs([("CC", "none"), ("RESIDYN_PYTHON", "none")])
                .output()
                .unwrap();
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{format}: {message}");
            assert!(fs::metadata(out).unwrap().len() < 2_000_000);
        }
    }
}
