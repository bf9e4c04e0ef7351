//! Whole answers on fixed logs, compared with those committed in `tests/golden`: a change that is not meant to change
//! answers changes none of these.
//!
//! `tests/run --bless` rewrites them after an intended change; the difference is then part of the commit.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::committed::{difference, is_as_committed, same_but_for_rounding};
use crate::support::mechanisms::fixture;
use crate::support::paths::{config, ours};
use crate::support::{Scratch, answers, measured, succeeds, text};

/// Left out: values that depend on the machine, the time, the version and the paths; values that only draw the numbers;
/// the settings, which are the same in all answers; and the errors with a network, which is trained in single
/// precision: between processors with and without AVX-512 they differ by up to a tenth.
const LEFT_OUT: [&str; 10] = [
    "with",
    "hybrid",
    "settings",
    "call",
    "configuration",
    "version",
    "files",
    "plots",
    "curves",
    "tried",
];

/// Close the loop with these arguments, and compare the answer with the committed one of this name.
fn answer_is_as_before(name: &str, arguments: &[&str]) {
    let scratch = Scratch::new();
    let out = scratch.out();
    let usual = ["closeloop", "--quiet", "--seed", "1", "--out", &out];
    answers(&[&usual, arguments].concat());
    let read = |file: &str| fs::read_to_string(scratch.path("out").join(file)).unwrap();
    let mut report: Value = serde_json::from_str(&read("report.json")).unwrap();
    leave_out(&mut report);
    let report = lines(&report, 0) + "\n";
    let model = read("model.toml");
    let (_, model) = model.split_once('\n').unwrap(); // The first line has the version.
    let folder = ours("tests/golden").join(name);
    for (file, found) in [("report.json", report.as_str()), ("model.toml", model)] {
        is_as_committed(&folder.join(file), found, same_but_for_rounding);
    }
}

#[test]
fn numbers_may_be_off_by_rounding_and_words_may_not() {
    let wanted = "F_c1 = { value = 0.16033436842865145, ci95 = [-1e-9, 0] }";
    for (from, to, is_same) in [
        ("0.16033436842865145", "0.16033436842865999", true),
        ("0.16033436842865145", "0.1603345", true),
        ("0.16033436842865145", "0.160335", false),
        ("-1e-9", "1e-9", false),
        ("0]", "1e-300]", false),
        ("F_c1", "F_c2", false),
        ("]", "", false),
    ] {
        let found = wanted.replace(from, to);
        assert_eq!(same_but_for_rounding(wanted, &found), is_same, "{to}");
    }
    let difference = |found: &str| difference("a\nb", found, same_but_for_rounding);
    assert_eq!(difference("a\nb"), None);
    assert!(difference("a").unwrap().contains("line 2"));
}

fn leave_out(value: &mut Value) {
    match value {
        Value::Object(entries) => {
            entries.retain(|key, _| !LEFT_OUT.contains(&key.as_str()));
            entries.values_mut().for_each(leave_out);
        }
        Value::Array(entries) => entries.iter_mut().for_each(leave_out),
        _ => (),
    }
}

/// JSON in lines that are short enough to read and long enough to be few.
fn lines(value: &Value, depth: usize) -> String {
    let short = value.to_string();
    let (indent, end) = ("  ".repeat(depth + 1), "  ".repeat(depth));
    let entries: Vec<String> = match value {
        Value::Object(entries) if short.len() > 100 => entries
            .iter()
            .map(|(key, entry)| format!("{indent}{key:?}: {}", lines(entry, depth + 1)))
            .collect(),
        Value::Array(entries) if short.len() > 100 => entries
            .iter()
            .map(|entry| format!("{indent}{}", lines(entry, depth + 1)))
            .collect(),
        _ => return short,
    };
    let brackets = if value.is_array() { "[]" } else { "{}" };
    let (open, close) = brackets.split_at(1);
    format!("{open}\n{}\n{end}{close}", entries.join(",\n"))
}

/// Four logs of 6 s of a plant, the last of which is the test log; and the answer on them.
fn simulated(name: &str, model: &str, plant: &str, effects: &[&str]) {
    let scratch = Scratch::new();
    let mut simulate = vec!["simulate", "--quiet", "--plant", plant, "--duration", "6"];
    if !effects.is_empty() {
        simulate.push("--effect");
        simulate.extend(effects);
    }
    let log = |seed: &str| {
        let log = text(&scratch.path(&format!("run{seed}.csv"))).to_owned();
        succeeds(&[&simulate[..], &["--seed", seed, "--out", &log]].concat());
        log
    };
    let [a, b, c, test] = ["1", "2", "3", "4"].map(log);
    let logs = ["--model", model, "--train", &a, &b, &c, "--test", &test];
    answer_is_as_before(name, &logs);
}

/// A committed log.
fn small(name: &str) -> String {
    text(&ours("tests/fixtures/logs").join(name)).to_owned()
}

/// The two-link arm whose log is committed.
fn small_arm_model(scratch: &Scratch) -> String {
    let (urdf, model) = (fixture("planar_2r.urdf"), scratch.path("planar_2r.toml"));
    let from = ["new", "--quiet", "--from-urdf", text(&urdf)];
    succeeds(&[&from[..], &["--out", text(&model)]].concat());
    text(&model).to_owned()
}

/// The answer for a committed log.
fn of_small_log(name: &str, log: &str, model: &str) {
    answer_is_as_before(name, &["--model", model, "--train", &small(log)]);
}

#[test]
fn small_pendulum() {
    of_small_log("small_pendulum", "pendulum.csv", "pendulum");
}

#[test]
fn small_servo() {
    of_small_log("small_servo", "servo.csv", "servo");
}

#[test]
fn small_arm() {
    let scratch = Scratch::new();
    of_small_log("small_arm", "arm.csv", &small_arm_model(&scratch));
}

#[test]
fn the_committed_logs_are_what_their_plants_write() {
    let scratch = Scratch::new();
    small_arm_model(&scratch);
    for name in ["pendulum", "servo", "arm"] {
        let plant = fs::read_to_string(small(&format!("{name}.toml"))).unwrap();
        let plant = scratch.file(&format!("{name}.toml"), plant);
        let log = scratch.path(&format!("{name}.csv"));
        let simulate = ["simulate", "--quiet", "--plant", &plant, "--seed", "1"];
        succeeds(&[&simulate[..], &["--out", text(&log)]].concat());
        let found = fs::read_to_string(log).unwrap();
        let committed = small(&format!("{name}.csv"));
        is_as_committed(committed.as_ref(), &found, same_but_for_rounding);
    }
}

#[test]
fn demo() {
    answer_is_as_before("demo", &[]);
}

#[test]
fn pendulum_with_dry_friction() {
    simulated(
        "pendulum_with_dry_friction",
        "pendulum",
        "pendulum",
        &["coulomb_friction=0.16"],
    );
}

#[test]
fn pendulum_with_drag() {
    simulated(
        "pendulum_with_drag",
        "pendulum",
        "pendulum",
        &["quadratic_drag=0.05"],
    );
}

#[test]
fn pendulum_with_two_kinds_of_friction() {
    simulated(
        "pendulum_with_two_kinds_of_friction",
        "pendulum",
        "pendulum",
        &["coulomb_friction=0.12", "viscous_friction=0.05"],
    );
}

#[test]
fn pendulum_with_a_delay() {
    simulated(
        "pendulum_with_a_delay",
        "pendulum",
        "pendulum",
        &["actuator_delay=0.02"],
    );
}

#[test]
fn servo() {
    let plant = config("plants/servo-real.toml");
    simulated("servo", "servo", &plant, &[]);
}

mod slow {
    use super::*;

    #[test]
    fn acrobot_with_dry_friction() {
        simulated(
            "acrobot_with_dry_friction",
            "acrobot",
            "acrobot",
            &["coulomb_friction@2=0.15"],
        );
    }

    #[test]
    fn acrobot_with_friction_and_a_spring() {
        simulated(
            "acrobot_with_friction_and_a_spring",
            "acrobot",
            "acrobot",
            &["viscous_friction@1=0.1", "joint_spring@2=0.4"],
        );
    }

    /// The paths of measured logs in a folder.
    fn paths(folder: &Path, names: &[&str]) -> Vec<String> {
        let path = |name: &&str| text(&folder.join(name)).to_owned();
        names.iter().map(path).collect()
    }

    fn measured_rig(name: &str, set: &str, model: &str, train: &[&str], test: &[&str]) {
        let Some(folder) = measured(set) else { return };
        let [train, test] = [train, test].map(|names| paths(&folder, names));
        let mut arguments = vec!["--model", model, "--train"];
        arguments.extend(train.iter().map(String::as_str));
        if !test.is_empty() {
            arguments.push("--test");
            arguments.extend(test.iter().map(String::as_str));
        }
        answer_is_as_before(name, &arguments);
    }

    /// An arm from the URDF that lies next to its logs.
    fn arm(name: &str, train: &[&str], test: &[&str]) {
        let Some(folder) = measured(name) else { return };
        let scratch = Scratch::new();
        let urdf = folder.join(format!("{name}.urdf"));
        let model: PathBuf = scratch.path(&format!("{name}.toml"));
        let from = ["new", "--from-urdf", text(&urdf), "--out", text(&model)];
        succeeds(&from);
        measured_rig(name, name, text(&model), train, test);
    }

    #[test]
    fn panda() {
        arm("panda", &["exciting_trajectory.csv"], &[]);
    }

    #[test]
    fn kuka_lwr4() {
        let (train, test) = (["measurements_1.csv"], ["measurements_2.csv"]);
        arm("kuka_lwr4", &train, &test);
    }

    #[test]
    fn dfki_simple_pendulum() {
        measured_rig(
            "dfki_simple_pendulum",
            "dfki_simple_pendulum",
            "pendulum",
            &["ddp_pd_tracking.csv"],
            &["direct_collocation_pd_tracking.csv"],
        );
    }

    #[test]
    fn dfki_double_pendulum() {
        let model = ours("docs/rigs/dfki_double_pendulum.toml");
        measured_rig(
            "dfki_double_pendulum",
            "dfki_double_pendulum_c0",
            text(&model),
            &["sysid_00.csv", "sysid_03.csv"],
            &["sysid_05.csv"],
        );
    }
}
